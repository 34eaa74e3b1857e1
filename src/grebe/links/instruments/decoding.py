"""Decodes lines and registers into readings. Without I/O, so that every format is easy to test."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import reduce

from grebe.core.quantities import Quantities
from grebe.core.units import Conversion, conversion, unit_of
from grebe.links.instruments.profile import Measured, Profile, Text


@dataclass(frozen=True, kw_only=True)
class DecodedReading:
    """One reading: values by quantity, in the registry's units, and the `stamp` of the instrument's
    own clock [unix s], None if it gives no time.
    """

    values: Mapping[str, float]
    stamp: float | None = None


@dataclass(kw_only=True)
class Counts:
    """Counts of readings, of damaged lines, and of other lines that are not readings; `unused`
    names the values that are sent but not kept.
    """

    readings: int = 0
    damaged: int = 0
    others: int = 0
    unused: dict[str, None] = field(default_factory=dict)


class ChannelMap:
    """The meaning of codes, columns and registers: a quantity, and its conversion to our unit."""

    def __init__(self, profile: Profile, quantities: Quantities) -> None:
        self._profile, self._quantities = profile, quantities

    def value(self, what: Measured, raw: float, unit: str = "") -> tuple[str, float] | None:
        """Return the quantity and its value in our unit; None if there is no conversion, or `raw`
        is not finite.
        """
        converts = self._conversion(what.quantity, unit or what.unit)
        if converts is None or not math.isfinite(raw):
            return None
        return what.quantity, float(converts.factor * raw + converts.offset)

    def of_code(self, code: str) -> Measured | None:
        """Return the meaning of a code; None if it is not kept."""
        return self._profile.codes.get(code.lstrip("0") or "0")

    def unit(self, name: str) -> str:
        """Return the unit for an instrument's own number or name of it."""
        return self._profile.units.get(name, name)

    def _conversion(self, key: str, unit: str) -> Conversion | None:
        wanted = self._quantities[key].unit
        return conversion(unit_of(unit) or unit, wanted, key) if unit else Conversion()


class TextDecoder:
    """Reads lines by a profile. `counts` are those of the lines so far, and `listed` are the codes
    of the fields if the instrument has listed them.
    """

    def __init__(self, profile: Profile, quantities: Quantities) -> None:
        assert profile.text is not None
        self._text: Text = profile.text
        self._channels = ChannelMap(profile, quantities)
        self.listed: tuple[str, ...] = ()
        self.counts = Counts()

    def take(self, raw: bytes) -> DecodedReading | None:
        """Return the reading of a line; None if it is damaged, or not a reading."""
        fields = self._fields(raw)
        if fields is None:
            return None
        found = dict(filter(None, self._values(fields)))
        if not found:
            self.counts.damaged += 1
            return None
        self.counts.readings += 1
        return DecodedReading(values=found, stamp=self._stamp(fields))

    def list_codes(self, raw: bytes) -> bool:
        """Learn the fields' codes from an answer to `list_codes`; return whether this is one."""
        words = raw.decode("ascii", "replace").replace("#", " ").split()
        if not words or not all(word.isdigit() for word in words):
            return False
        self.listed = tuple(words)
        return True

    def _fields(self, raw: bytes) -> list[str] | None:
        """Return the fields of a line; None if it is damaged, or not a reading."""
        text = self._text
        try:
            line = raw.decode("ascii").strip().lstrip("#>").strip()
        except UnicodeDecodeError:
            self.counts.damaged += 1
            return None
        if not line or not line.startswith(text.begins):
            self.counts.others += bool(line)
            return None
        body, star, checksum = line.partition("*")
        if text.checksum == "required" and not (star and _checksum_holds(body, checksum)):
            self.counts.damaged += 1
            return None
        body = body if text.checksum != "none" else line
        fields = [f.strip() for f in body.split(text.delimiter)] if text.delimiter else body.split()
        if text.width and len(fields) != text.width:
            self.counts.damaged += 1
            return None
        return fields

    def _values(self, fields: Sequence[str]) -> list[tuple[str, float] | None]:
        text, meanings = self._text, self._channels
        found = [
            self._measured(Measured(quantity=one.quantity, unit=one.unit), fields, one.at)
            for one in text.columns
        ]
        for one in text.coded:
            unit = meanings.unit(fields[one.unit_at - 1]) if 0 < one.unit_at <= len(fields) else ""
            found.append(self._coded(_at(fields, one.code_at), _at(fields, one.value_at), unit))
        if text.pairs_from:
            rest = fields[text.pairs_from - 1 :]
            found += [self._coded(c, v, "") for c, v in zip(rest[::2], rest[1::2], strict=False)]
        if self.listed and len(self.listed) == len(fields):
            found += [self._coded(c, v, "") for c, v in zip(self.listed, fields, strict=True)]
        return found

    def _measured(
        self, what: Measured, fields: Sequence[str], at: int, unit: str = ""
    ) -> tuple[str, float] | None:
        raw = _number(_at(fields, at))
        return None if raw is None else self._channels.value(what, raw, unit)

    def _coded(self, code: str, value: str, unit: str) -> tuple[str, float] | None:
        what, raw = self._channels.of_code(code), _number(value)
        if what is None:
            self.counts.unused[f"code {code}"] = None
        return None if what is None or raw is None else self._channels.value(what, raw, unit)

    def _stamp(self, fields: Sequence[str]) -> float | None:
        stamp = self._text.stamp
        if stamp is None:
            return None
        try:
            checksum = datetime.strptime(" ".join(_at(fields, i) for i in stamp.at), stamp.format)
        except ValueError:
            return None
        return (checksum if checksum.tzinfo else checksum.replace(tzinfo=UTC)).timestamp()


class RegisterDecoder:
    """Reads registers by a profile; `read` (first register, count) fetches them."""

    def __init__(self, profile: Profile, quantities: Quantities) -> None:
        assert profile.modbus is not None
        self._modbus = profile.modbus
        self._channels = ChannelMap(profile, quantities)
        self.counts = Counts()

    def take(
        self,
        read: Callable[[int, int], Sequence[int]],
        as_float: Callable[[Sequence[int]], float],
    ) -> DecodedReading | None:
        """Return the reading of the registers; `as_float` converts two of them to a number."""
        found = dict(filter(None, [*self._fixed(read, as_float), *self._listed(read, as_float),
                                   *self._blocks(read, as_float)]))  # fmt: skip
        if not found:
            self.counts.damaged += 1
            return None
        self.counts.readings += 1
        return DecodedReading(values=found)

    def _fixed(
        self,
        read: Callable[[int, int], Sequence[int]],
        as_float: Callable[[Sequence[int]], float],
    ) -> list[tuple[str, float] | None]:
        found: list[tuple[str, float] | None] = []
        for one in self._modbus.values:
            words = read(one.register, 2 if one.kind == "float" else 1)
            raw = as_float(words) if one.kind == "float" else _signed(words[0])
            what = Measured(quantity=one.quantity, unit=one.unit)
            found.append(self._channels.value(what, one.scale * raw))
        return found

    def _listed(
        self,
        read: Callable[[int, int], Sequence[int]],
        as_float: Callable[[Sequence[int]], float],
    ) -> list[tuple[str, float] | None]:
        listed = self._modbus.listed
        if listed is None:
            return []
        codes, states = read(listed.codes, listed.count), read(listed.states, listed.count)
        words = read(listed.values, 2 * listed.count)
        found: list[tuple[str, float] | None] = []
        for i, (code, state) in enumerate(zip(codes, states, strict=True)):
            if code == 0 or state != 0:
                continue
            found.append(self._coded(str(code), as_float(words[2 * i : 2 * i + 2]), ""))
        return found

    def _blocks(
        self,
        read: Callable[[int, int], Sequence[int]],
        as_float: Callable[[Sequence[int]], float],
    ) -> list[tuple[str, float] | None]:
        found: list[tuple[str, float] | None] = []
        for at in self._modbus.blocks:
            words = read(at, 5)
            code, unit, quality = words[2:5]
            if code and quality == 0:
                name = self._channels.unit(str(unit))
                found.append(self._coded(str(code), as_float(words[:2]), name))
        return found

    def _coded(self, code: str, raw: float, unit: str) -> tuple[str, float] | None:
        what = self._channels.of_code(code)
        if what is None:
            self.counts.unused[f"code {code}"] = None
            return None
        return self._channels.value(what, raw, unit)


def xor_sum(body: str) -> int:
    """Return the exclusive or of all characters after a leading $."""
    return reduce(lambda a, b: a ^ b, body.removeprefix("$").encode(), 0)


def _checksum_holds(body: str, checksum: str) -> bool:
    try:
        return int(checksum[:2], 16) == xor_sum(body)
    except ValueError:
        return False


def _at(fields: Sequence[str], at: int) -> str:
    return fields[at - 1] if 0 < at <= len(fields) else ""


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    # Python accepts 1_2 as 12.
    return number if "_" not in text and math.isfinite(number) else None


def _signed(word: int) -> int:
    return word - 0x10000 if word & 0x8000 else word
