"""A small writer of ArduPilot's DataFlash logs: FMT records describe the others, rows follow."""

import struct

# Format characters of a message, and their packing.
_PACKED = {"Q": "Q", "f": "f", "d": "d", "B": "B", "H": "H", "h": "h", "i": "i", "I": "I",
           "L": "i", "c": "h", "C": "H", "N": "16s", "n": "4s", "Z": "64s"}  # fmt: skip
_SCALE = {"L": 1e7, "c": 100.0, "C": 100.0}
HEAD = b"\xa3\x95"
FMT = 0x80


class DataflashWriter:
    """Collects the bytes of a log."""

    def __init__(self):
        self.data = bytearray()
        self._types = {}
        self._define(FMT, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")

    def define(self, name, form, columns):
        """Describe a message; its rows may follow."""
        number = FMT + 1 + len(self._types)
        self._types[name] = (number, form)
        self._define(number, name, form, columns)

    def row(self, name, *values):
        """Write one row."""
        number, form = self._types[name]
        cells = []
        for kind, value in zip(form, values, strict=True):
            cell = round(value * _SCALE[kind]) if kind in _SCALE else value
            cells.append(cell.encode() if isinstance(cell, str) else cell)
        packed = "<" + "".join(_PACKED[kind] for kind in form)
        self.data += HEAD + bytes([number]) + struct.pack(packed, *cells)

    def _define(self, number, name, form, columns):
        size = 3 + struct.calcsize("<" + "".join(_PACKED[kind] for kind in form))
        self.data += HEAD + bytes([FMT]) + struct.pack(
            "<BB4s16s64s", number, size, name.encode(), form.encode(), columns.encode()
        )  # fmt: skip
