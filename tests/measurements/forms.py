"""One recording of known content in forms that compose, and what the reader makes of each: right, refused well, wrong.

Position and duty cycles are ramps, so that each sample says its true time: what is late, lost or scaled shows.

    python tests/measurements/forms.py > benchmarks/results/forms.md
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from itertools import combinations
from pathlib import Path

import numpy as np

from clutchid.errors import ClutchidError
from clutchid.log import Log
from clutchid.measurements import read

#: Length in s, intervals of position and valves in s, and by how much the valves' stamps are later.
LENGTH, DENSE, WIDE, LATER = 6.0, 0.002, 0.01, 4e-4

#: The features of a form: the first of each is the plain one.
FEATURES: Mapping[str, tuple[str, ...]] = {
    "format": ("csv", "parquet", "jsonl", "mf4", "mat", "asc", "candump"),
    "clock": ("plain", "restart", "wrap", "jump", "lone", "midnight", "negative", "burst", "jitter", "slower"),
    "layout": ("one", "group", "sparse", "own"),
    "units": ("bracket", "row", "german", "none", "other"),
    "text": ("comma", "semicolon", "tab-utf16", "cp1252", "bom", "blanks"),
    "codes": ("none", "empty", "code", "word"),
    "order": ("sorted", "late"),
    "times": ("seconds", "since 1970", "days", "iso", "german date", "month", "sec", "no zeros"),
    "lines": ("samples", "remark", "names again", "blank lines", "text at the end"),
}

#: Words of a refusal that names a feature.
WORDS = {
    "none": r"unit", "code": r"no value|not (a )?number", "restart": r"restart", "own": r"all mean 'time'",
    "burst": r"burst", "row": r"unit", "no zeros": r"lack zeros",
}  # fmt: skip

_TABLES = ("csv", "parquet", "jsonl")
_FRAMES = ("asc", "candump")

#: Values that each feature has only in these formats.
_ONLY = {
    "group": ("mf4", "mat", *_FRAMES), "sparse": _TABLES, "own": ("csv", "parquet"), "row": ("csv",),
    "other": _TABLES, "word": ("csv",),
    **dict.fromkeys([*FEATURES["text"][1:], *FEATURES["times"][1:], *FEATURES["lines"][1:]], ("csv",)),
}  # fmt: skip

#: When the recording began, in s since 1970 and as a date of Excel, and its day as it is written.
_BEGAN, _EXCEL, _DAYS = (
    1714564800,
    45413.5,
    {"iso": "2024-05-{:02d}T", "german date": "{:02d}.05.2024 ", "month": "{:02d}-May-2024 "},
)

DBC = """VERSION ""
BO_ 256 State: 8 TCU
 SG_ {position} : 0|16@1+ (0.001,0) [0|64] "{mm}" LOG
BO_ 257 Valves: 8 TCU
 SG_ {supply} : 0|16@1+ (0.01,0) [0|100] "{percent}" LOG
 SG_ {exhaust} : 16|16@1+ (0.01,0) [0|100] "{percent}" LOG
"""


@dataclass(frozen=True, slots=True)
class Form:
    """A form of the recording, by its features."""

    format: str = "csv"
    clock: str = "plain"
    layout: str = "one"
    units: str = "bracket"
    text: str = "comma"
    codes: str = "none"
    order: str = "sorted"
    times: str = "seconds"
    lines: str = "samples"

    @property
    def exists(self) -> bool:
        """Whether the format has all of these features."""
        values = [getattr(self, item.name) for item in fields(self)]
        if self.format in _FRAMES and (self.layout == "one" or self.codes == "empty"):
            return False
        if self.text == "blanks" and (self.codes == "empty" or self.layout != "one"):  # no cell may be empty
            return False
        if (self.clock == "slower" or self.times == "no zeros") and self.layout != "one":
            return False
        if self.units == "other" and (self.times != "seconds" or self.clock == "midnight"):
            return False
        if self.text == "blanks" and self.times in ("german date", "month", "sec"):  # no cell may have one
            return False
        return all(self.format in _ONLY.get(value, (self.format,)) for value in values)

    @property
    def unusual(self) -> list[str]:
        """The features that are not plain."""
        return [getattr(self, name) for name, values in FEATURES.items() if getattr(self, name) != values[0]]


def forms(count: int) -> Iterator[tuple[tuple[str, ...], Form]]:
    """The forms with `count` features that are not plain, each in the formats that have them, and these features."""
    axes = [name for name in FEATURES if name != "format"]
    for names in combinations(axes, count):
        chosen: list[dict[str, str]] = [{}]
        for name in names:
            chosen = [{**earlier, name: value} for earlier in chosen for value in FEATURES[name][1:]]
        for features in chosen:
            for form in FEATURES["format"]:
                layout = {"layout": "group"} if form in _FRAMES and "layout" not in features else {}
                made = Form(**{"format": form, **layout, **features})
                if made.exists:
                    yield tuple(features.values()), made


def write(form: Form, folder: Path) -> tuple[Path, list[Path]]:
    """The recording in this form, and its DBC files."""
    grids = _grids(form)
    names = _names(form)
    suffix = {"candump": "log"}.get(form.format, form.format)
    path = folder / f"run.{suffix}"
    if form.format in _FRAMES:
        return path, [_frames(form, grids, names, path)]
    if form.format == "mf4":
        _mf4(grids, names, path)
    elif form.format == "mat":
        _mat(form, grids, names, path)
    else:
        _table(form, _joined(form, grids), names, path)
    return path, []


Grid = tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]


def _grids(form: Form) -> list[Grid]:
    """Time grids: true time, stamps as written, and columns in mm and %; a code is -1."""
    dense = np.arange(0.0, LENGTH, DENSE)
    other = dense if form.layout == "one" else np.arange(0.0, LENGTH, WIDE) + LATER
    position = 1.0 + 3.0 * dense
    if form.codes != "none":
        position[700:720] = np.nan if form.codes == "empty" else -1.0
    valves = {"duty_supply": 5.0 + 15.0 * other, "duty_exhaust": 95.0 - 15.0 * other}
    grids = [(dense, {"position": position}), (other, valves)]
    if form.layout == "one":
        grids = [(dense, {"position": position, **valves})]
    if form.clock == "slower":
        rows = (dense < LENGTH / 2) | (np.arange(dense.size) % 7 == 0)
        grids = [(time[rows], {name: x[rows] for name, x in columns.items()}) for time, columns in grids]
    return [_disordered(form, (time, _stamped(form.clock, time), columns)) for time, columns in grids]


def _stamped(clock: str, time: np.ndarray) -> np.ndarray:
    noise = np.random.default_rng(3).uniform(-0.2, 0.2, time.size) * (time[1] - time[0])
    lone = np.where(np.abs(time - 2.0) < 1e-9, 60.0, 0.0)
    clocks = {
        "plain": time,
        "restart": np.where(time < 3.0, time, time - 3.0),
        "wrap": np.round((time + 62.5) % 65.536, 9),
        "jump": time + np.where((time >= 2.0) & (time < 4.0), 1e5, 0.0),
        "lone": time + lone,
        "midnight": np.round((time + 86397.0) % 86400.0, 9),
        "negative": time - 2.0,
        "burst": np.floor(time / 0.016 + 1e-9) * 0.016,
        "jitter": time + noise,
        "slower": time,
    }
    return np.round(clocks[clock], 9)


def _disordered(form: Form, grid: Grid) -> Grid:
    if form.order == "sorted":
        return grid
    time, stamps, columns = grid
    order = np.arange(time.size)
    for at in (300, 310, 450):
        order[[at, at + 1]] = order[[at + 1, at]]
    return time[order], stamps[order], {name: values[order] for name, values in columns.items()}


def _names(form: Form) -> dict[str, tuple[str, str]]:
    """Name and unit of each column."""
    words = ("time", "position", "duty_supply", "duty_exhaust")
    if form.units == "german":
        words = ("Zeit", "Kupplungsweg", "Ventil_Belueften", "Ventil_Entlueften")
    units = {"none": ("", "", "", ""), "other": ("ms", "µm", "1", "1")}.get(form.units, ("s", "mm", "%", "%"))
    units = ({"days": "d"}.get(form.times, units[0]) if units[0] else "", *units[1:])
    return dict(zip(("time", "position", "duty_supply", "duty_exhaust"), zip(words, units, strict=True), strict=True))


def _scaled(form: Form, name: str, values: np.ndarray) -> np.ndarray:
    """Values in the unit that is written, without a unit in SI, as a guess from the range expects."""
    if form.units == "other":
        return values * (1e3 if name in ("time", "position") else 1e-2)
    if form.units != "none" or name == "time":
        return values
    return values * (1e-3 if name == "position" else 1e-2)


Columns = list[tuple[str, np.ndarray]]


def _joined(form: Form, grids: list[Grid]) -> Columns:
    """The columns of a table: of one grid, of rows that hold only what arrived, or with times of their own."""
    if form.layout == "own":
        return [
            (name, values)
            for _, stamps, columns in grids
            for first, samples in columns.items()
            for name, values in (("time", _scaled(form, "time", stamps)), (first, _scaled(form, first, samples)))
        ]
    if form.layout == "one":
        ((_, stamps, columns),) = grids
        return [
            ("time", _scaled(form, "time", stamps)),
            *((name, _scaled(form, name, values)) for name, values in columns.items()),
        ]
    arrival = np.concatenate(
        [np.arange(time.size) * (LENGTH / time.size) + i * 1e-6 for i, (time, _, _) in enumerate(grids)]
    )
    order = np.argsort(arrival, kind="stable")
    stamps = np.concatenate([stamps for _, stamps, _ in grids])[order]
    sizes = [time.size for time, _, _ in grids]
    table: Columns = [("time", _scaled(form, "time", stamps))]
    for i, (_, _, columns) in enumerate(grids):
        for name, values in columns.items():
            whole = np.full(sum(sizes), np.nan)
            whole[sum(sizes[:i]) : sum(sizes[: i + 1])] = _scaled(form, name, values)
            table.append((name, whole[order]))
    return table


def _table(form: Form, columns: Columns, names: Mapping[str, tuple[str, str]], path: Path) -> None:
    headings = [f"{names[name][0]} [{names[name][1]}]" if names[name][1] else names[name][0] for name, _ in columns]
    size = max(values.size for _, values in columns)
    if form.format == "parquet":
        import polars as pl

        texts = [heading if headings.index(heading) == i else f"{heading} ({i})" for i, heading in enumerate(headings)]
        padded = [np.append(values, np.full(size - values.size, np.nan)) for _, values in columns]
        coded = [
            np.where((values == _code(form, name)) & (name == "position"), np.nan, values)
            for (name, _), values in zip(columns, padded, strict=True)
        ]
        frame = pl.DataFrame(dict(zip(texts, coded, strict=True))).with_columns(pl.all().fill_nan(None))
        frame.write_parquet(path)
        return
    cells = [
        [_cell(form, name, value) for value in values.tolist()] + [""] * (size - values.size)
        for name, values in columns
    ]
    if form.format == "jsonl":
        rows = [
            {
                heading: float(cell) if cell != "SNA" else cell
                for heading, cell in zip(headings, row, strict=True)
                if cell
            }
            for row in zip(*cells, strict=True)
        ]
        path.write_text("\n".join(map(json.dumps, rows)) + "\n")
        return
    separator = {"semicolon": ";", "tab-utf16": "\t", "cp1252": ";", "blanks": "  "}.get(form.text, ",")
    lines = [separator.join(row) for row in zip(*cells, strict=True)]
    if form.text == "semicolon":
        lines = [re.sub(r"\.(?=(\d+|#IND)( sec)?(;|$))", ",", line) for line in lines]
    above = [separator.join(headings)]
    if form.units == "row":
        above = [
            separator.join(names[name][0] for name, _ in columns),
            separator.join(names[name][1] for name, _ in columns),
        ]
    if form.text == "cp1252":
        above.insert(0, f"Prüfstand{separator}7")
    half = len(lines) // 2
    lines = {
        "remark": [*lines[:half], "# an event", *lines[half:], "# end of the recording"],
        "names again": [*lines[:half], above[-1], *lines[half:]],
        "blank lines": [*lines[:half], "", "", *lines[half:], "", ""],
        "text at the end": [*lines, "End of file"],
    }.get(form.lines, lines)
    encoding = {"tab-utf16": "utf-16", "cp1252": "cp1252", "bom": "utf-8-sig"}.get(form.text, "utf-8")
    path.write_text("\n".join([*above, *lines]) + "\n", encoding=encoding)


def _code(form: Form, name: str) -> float:
    return float(_scaled(form, name, np.array([-1.0]))[0])


def _cell(form: Form, name: str, value: float) -> str:
    if np.isnan(value):
        return ""
    if name == "position" and value == _code(form, name):
        return "1.#IND" if form.codes == "word" else "SNA"
    if name == "time" and form.times != "seconds":
        return _time(form, value)
    if name == "time" and form.clock == "midnight" and form.units != "none" and form.format == "csv":
        whole = round(value * 1e6)
        return (
            f"{whole // 3600000000:02d}:{whole // 60000000 % 60:02d}:{whole // 1000000 % 60:02d}.{whole % 1000000:06d}"
        )
    return f"{value:.9g}" if name != "time" else f"{value:.9f}".rstrip("0").rstrip(".")


def _time(form: Form, stamp: float) -> str:
    """A stamp in s as it is written."""
    if form.times in _DAYS:
        day, whole = divmod(round((stamp + 43200.0) * 1e6), 86_400_000_000)
        clock = f"{whole // 3600000000:02d}:{whole // 60000000 % 60:02d}:{whole // 1000000 % 60:02d}"
        return f"{_DAYS[form.times].format(2 + day)}{clock}.{whole % 1000000:06d}"
    milliseconds = round(stamp * 1e3)
    return {
        "since 1970": f"{_BEGAN + stamp:.6f}",
        "days": f"{_EXCEL + stamp / 86400.0:.12f}",
        "sec": f"{stamp:.6f} sec",
        "no zeros": f"{milliseconds // 1000}.{milliseconds % 1000}",
    }[form.times]


def _mf4(grids: list[Grid], names: Mapping[str, tuple[str, str]], path: Path) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as mdf:
        for _, stamps, columns in grids:
            signals = []
            for name, values in columns.items():
                text, unit = names[name]
                scale = 1.0 if unit else (1e-3 if name == "position" else 1e-2)
                signals.append(Signal(np.where(values == -1.0, np.nan, values) * scale, stamps, unit=unit, name=text))
            mdf.append(signals, common_timebase=True)
        mdf.save(path, overwrite=True)


def _mat(form: Form, grids: list[Grid], names: Mapping[str, tuple[str, str]], path: Path) -> None:
    from scipy.io import savemat

    structs = {}
    for i, (_, stamps, columns) in enumerate(grids):
        values = {names["time"][0]: stamps}
        for name, samples in columns.items():
            values[names[name][0]] = _scaled(form, name, np.where(samples == -1.0, np.nan, samples))
        units = {names[name][0]: names[name][1] for name in ("time", *columns) if names[name][1]}
        structs[f"grid{i}"] = {**values, "units": units} if units else values
    savemat(path, structs)


def _frames(form: Form, grids: list[Grid], names: Mapping[str, tuple[str, str]], path: Path) -> Path:
    rows = []
    for identifier, (time, stamps, columns) in zip((0x100, 0x101), grids, strict=True):
        scales = {"position": 1000.0, "duty_supply": 100.0, "duty_exhaust": 100.0}
        raw = [np.where(values == -1.0, 0xFFFF, np.round(values * scales[name])) for name, values in columns.items()]
        for at, stamp, *numbers in zip(
            np.sort(time).tolist(), stamps.tolist(), *(values.tolist() for values in raw), strict=True
        ):
            payload = b"".join(int(number).to_bytes(2, "little") for number in numbers)
            rows.append((at, stamp, identifier, payload.ljust(8, b"\0")))
    rows.sort(key=lambda row: row[0])
    if form.format == "asc":
        head = ["date Wed May 1 12:00:00.000 pm 2024", "base hex  timestamps absolute", "no internal events logged"]
        lines = [
            f"{stamp:11.6f} 1  {identifier:X}  Rx   d 8 {data.hex(' ').upper()}" for _, stamp, identifier, data in rows
        ]
    else:
        head = []
        lines = [
            f"({1714564800 + stamp:.6f}) can0 {identifier:X}#{data.hex().upper()}"
            for _, stamp, identifier, data in rows
        ]
    path.write_text("\n".join([*head, *lines]) + "\n")
    dbc = path.with_suffix(".dbc")
    words = {"position": names["position"][0], "supply": names["duty_supply"][0], "exhaust": names["duty_exhaust"][0]}
    dbc.write_text(DBC.format(**words, mm=names["position"][1], percent=names["duty_supply"][1]))
    return dbc


def outcome(form: Form) -> tuple[str, str]:
    """What the reader makes of a form, ``right``, ``refused`` or ``wrong``, and why."""
    with tempfile.TemporaryDirectory() as folder:
        path, dbc = write(form, Path(folder))
        try:
            log = read(path, dbc=dbc)
        except ClutchidError as error:
            words = [WORDS[value] for value in form.unusual if value in WORDS]
            said = str(error)
            well = bool(words) and re.search("|".join(words), said) is not None
            return ("refused" if well else "wrong"), said.replace(folder, "")
        except Exception as error:  # the table shows it
            return "wrong", f"{type(error).__name__}: {error}"
    return ("wrong", problem) if (problem := wrong_in(form, log)) else ("right", "")


def wrong_in(form: Form, log: Log) -> str:
    """What is wrong in a recording that was read; empty where nothing is."""
    by_position = (log["position"] * 1e3 - 1.0) / 3.0
    by_supply, by_exhaust = (log["duty_supply"] * 1e2 - 5.0) / 15.0, (95.0 - log["duty_exhaust"] * 1e2) / 15.0
    measured = np.isfinite(by_position)
    usual = max(DENSE, float(np.median(np.diff(log.time))) - 1e-9)
    share = 0.5 if form.clock == "slower" else 0.9
    if np.count_nonzero(measured) < share * LENGTH / usual:
        return f"only {np.count_nonzero(measured)} samples of the position"
    slack = DENSE + (2 * 0.016 if form.clock == "burst" else 0.3 * WIDE if form.clock == "jitter" else 1e-3)
    held = WIDE if form.layout != "one" else 0.0
    held *= 2 if form.order == "late" else 1  # a valve sample that is out of order is dropped, and said to be
    for name, times in (("duty_supply", by_supply), ("duty_exhaust", by_exhaust)):
        late = (by_position - times)[measured & np.isfinite(times)]
        if late.size < share * np.count_nonzero(measured):
            return f"only {late.size} samples of {name}"
        if late.min() < -slack or late.max() > held + slack:
            return f"{name} is {late.min():.4g} to {late.max():.4g} s late"
    number = np.cumsum(np.diff(log.time, prepend=log.time[0]) > (10 * DENSE if form.clock == "restart" else np.inf))
    if number[-1] != (form.clock == "restart"):
        return f"{number[-1] + 1} runs"
    runs = [np.flatnonzero(measured & (number == n)) for n in range(number[-1] + 1)]
    for run in runs:
        offset = by_position[run] - log.time[run]
        if np.ptp(offset) > slack:
            return f"stamps drift by {np.ptp(offset):.4g} s"
    return ""


def report() -> str:
    """The table of pairs, and the forms that are wrong."""
    cells: dict[tuple[str, ...], list[str]] = {}
    wrong, said = [], {}
    for count in (1, 2):
        for features, form in forms(count):
            result, why = outcome(form)
            cells.setdefault(features, []).append(result)
            if result == "wrong":
                wrong.append(f"- {form}: {why.splitlines()[0][:200]}")
            elif result == "refused":
                said[(features, form.format)] = why
    kinds = [value for name, values in FEATURES.items() if name != "format" for value in values[1:]]
    lines = [
        "# Forms of one recording", "",
        "`python tests/measurements/forms.py`: the same content in every format that has a feature, or two, and what",
        "the reader makes of it: forms that are right / refused in a sentence that names a feature / wrong. Single",
        "features are on the diagonal.", "",
        "| | " + " | ".join(kinds) + " |", "|---" * (len(kinds) + 1) + "|",
    ]  # fmt: skip
    total = {"right": 0, "refused": 0, "wrong": 0}
    for row in kinds:
        shown = []
        for column in kinds:
            results = cells.get((row,) if row == column else (row, column), [])
            counts = [results.count(kind) for kind in total]
            shown.append("/".join(map(str, counts)) if results else "")
            for kind, number in zip(total, counts, strict=True):
                total[kind] += number
        lines.append(f"| {row} | " + " | ".join(shown) + " |")
    lines += [
        "",
        f"{total['right']} forms are right, {total['refused']} are refused well, {total['wrong']} are wrong.",
        *wrong,
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))
    print(report())
