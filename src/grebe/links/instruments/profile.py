"""Profiles of instruments, read from TOML; docs/how-to/connect-a-sonde.md lists them.

A profile says how to read lines of text (including NMEA sentences) or Modbus registers, and which
quantity each value is, in which unit. Some instruments identify quantities by code numbers, and
`codes` gives their meaning.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

import msgspec

from grebe.core.errors import InputError
from grebe.core.quantities import BUILTIN, Quantities
from grebe.core.units import conversion, unit_of

BUILT_IN = Path(__file__).parent / "profiles"
_FRAME = re.compile(r"[5-8][NEOMS][12]")


class Measured(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A quantity by its key, and the unit in which the instrument gives it; empty for our own."""

    quantity: str
    unit: str = ""


class Column(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A field of a line, counted from 1, with its quantity and unit."""

    at: int
    quantity: str
    unit: str = ""


class Coded(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A field with a code, the field with its value, and the field with its unit, 0 for none."""

    code_at: int
    value_at: int
    unit_at: int = 0


class Stamp(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The fields of an instrument's own time, joined by a space, and their format."""

    at: tuple[int, ...]
    format: str


class Text(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The format of lines of text.

    Lines that do not begin with `begins` are skipped. Fields are split at `delimiter`, or at white
    space if it is empty. `checksum` is the exclusive or between $ and *, as in NMEA. `width` is the
    number of fields of a line, 0 if that varies. `columns`, `coded` and `pairs_from` (code, value,
    code, value and so on) say where the values are. `setup` is sent once at first, and `ask` every
    `every_s` [s] to request a line. The answer to `list_codes` gives the code of each field.
    """

    begins: str = ""
    delimiter: str = ","
    checksum: Literal["none", "optional", "required"] = "none"
    width: int = 0
    columns: tuple[Column, ...] = ()
    coded: tuple[Coded, ...] = ()
    pairs_from: int = 0
    stamp: Stamp | None = None
    setup: tuple[str, ...] = ()
    list_codes: str = ""
    ask: str = ""
    every_s: float = 1.0


class Register(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A value in two registers (a float) or one (an integer), which is multiplied by `scale`."""

    register: int
    quantity: str
    unit: str = ""
    kind: Literal["float", "int"] = "float"
    scale: float = 1.0


class Listed(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The first registers of the lists of `count` codes, of their states (0 is good), and of their
    values, which are floats.
    """

    codes: int
    states: int
    values: int
    count: int


class Write(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A register that is written before each reading, to start a measurement."""

    register: int
    value: int


class Modbus(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Registers over Modbus.

    `first` is the manual's number of the first register, 0 or 1, and `order` the order of a float's
    bytes. `blocks` are registers at which a float is followed by its code, the number of its unit
    and its quality (0 is good).
    """

    device: int = 1
    first: int = 0
    order: Literal["ABCD", "CDAB"] = "ABCD"
    every_s: float = 1.0
    write: tuple[Write, ...] = ()
    wait_s: float = 0.0
    values: tuple[Register, ...] = ()
    listed: Listed | None = None
    blocks: tuple[int, ...] = ()


class Serial(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The settings of the serial line, if the instrument is on one."""

    baud: int = 9600
    frame: str = "8N1"


class Profile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One kind of instrument.

    `source` says where its format is described. `codes` gives the meaning of its codes, and `units`
    that of its numbers or names of units. `late_s` is the delay of its readings.
    """

    title: str
    source: str
    setting_up: str = ""
    serial: Serial = msgspec.field(default_factory=Serial)
    text: Text | None = None
    modbus: Modbus | None = None
    codes: dict[str, Measured] = {}
    units: dict[str, str] = {}
    late_s: float = 0.0

    @property
    def measured(self) -> tuple[Measured, ...]:
        """Everything that the instrument may measure."""
        fixed = [
            *(self.text.columns if self.text else ()),
            *(self.modbus.values if self.modbus else ()),
        ]
        return (
            *(Measured(quantity=one.quantity, unit=one.unit) for one in fixed),
            *self.codes.values(),
        )

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of the quantities that the instrument may measure, each once."""
        return tuple(dict.fromkeys(one.quantity for one in self.measured))


def profile_names() -> list[str]:
    """Return the names of the built-in profiles."""
    return sorted(path.stem for path in BUILT_IN.glob("*.toml"))


def profile_named(name: str, quantities: Quantities = BUILTIN) -> Profile:
    """Return the built-in profile of a name, or the profile in a file whose name ends in .toml.

    Raises `InputError`, which says what is wrong with it.
    """
    path = Path(name) if name.endswith(".toml") else BUILT_IN / f"{name}.toml"
    if not path.is_file():
        raise InputError(
            f"There is no instrument profile {name!r}; give a file that ends in .toml, or one of "
            f"{', '.join(profile_names())}."
        )
    try:
        profile = msgspec.toml.decode(path.read_bytes(), type=Profile)
        _check(profile, quantities)
    except (msgspec.DecodeError, InputError, OSError) as error:
        raise InputError(f"The instrument profile {path.name}: {error}") from None
    return profile


def is_frame(text: str) -> bool:
    """Whether a text gives bits, parity and stop bits, such as 8N1."""
    return _FRAME.fullmatch(text) is not None


def _check(profile: Profile, quantities: Quantities) -> None:
    """Raise `InputError` for a profile that could not be used."""
    if (profile.text is None) == (profile.modbus is None):
        raise InputError("give either a table [text] or a table [modbus].")
    if not is_frame(profile.serial.frame) or profile.serial.baud <= 0:
        raise InputError(f"a serial frame is written like 8N1, not {profile.serial.frame!r}.")
    if not profile.measured:
        raise InputError("none of its values names a quantity.")
    for one in profile.measured:
        wanted = quantities.known(one.quantity).unit
        if one.unit and conversion(unit_of(one.unit) or one.unit, wanted, one.quantity) is None:
            raise InputError(
                f"{one.quantity} is stored in {wanted or '1'}, to which {one.unit!r} cannot be "
                "converted."
            )
