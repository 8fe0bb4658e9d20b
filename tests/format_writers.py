"""One table written the way each logger's format holds it."""

import gzip
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import openpyxl
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter


def synthetic(rows: int = 400, seed: int = 3) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return a short made-up recording with full double precision, and its units."""
    random = np.random.default_rng(seed)
    time = np.arange(rows) * 0.005
    table = pd.DataFrame(
        {
            "time": time,
            "P1": 20.0 + random.normal(size=rows),
            "P2": 30.0 + random.normal(size=rows),
            "pos": 150.0 * np.sin(time) + 1e-9 * random.normal(size=rows),
        }
    )
    return table, {"time": "s", "P1": "bar", "P2": "bar", "pos": "mm"}


def csv_text(table: pd.DataFrame, units: Mapping[str, str], delimiter: str = ",", decimal: str = ".") -> str:
    names = [f"{name} [{units[name]}]" if name in units else str(name) for name in table.columns]
    rows = [delimiter.join(repr(float(value)) for value in row) for row in table.to_numpy()]
    return "\n".join([delimiter.join(names), *(row.replace(".", decimal) for row in rows), ""])


def write_csv(path: Path, table: pd.DataFrame, units: Mapping[str, str], delimiter: str = ",") -> None:
    path.write_text(csv_text(table, units, delimiter), encoding="utf-8", newline="")


def write_decimal_comma(path: Path, table: pd.DataFrame, units: Mapping[str, str]) -> None:
    path.write_bytes(csv_text(table, units, ";", ",").replace("\n", "\r\n").encode("cp1252"))


def write_csv_gz(path: Path, table: pd.DataFrame, units: Mapping[str, str]) -> None:
    path.write_bytes(gzip.compress(csv_text(table, units).encode(), mtime=0))


def write_matlab5(path: Path, table: pd.DataFrame, units: Mapping[str, str]) -> None:
    """Write column vectors, a struct of units, a scalar and a text, compressed as ``save`` does."""
    variables: dict[str, Any] = {name: table[name].to_numpy()[:, None] for name in table.columns}
    variables |= {"units": dict(units), "serial": 42.0, "operator": "nobody"}
    scipy.io.savemat(path, variables, do_compression=True)


def write_matlab73(path: Path, table: pd.DataFrame, units: Mapping[str, str]) -> None:
    """Write HDF5 as MATLAB does: a 512-byte block with its text header, its classes, its axes turned round."""
    with h5py.File(path, "w", userblock_size=512, libver="earliest") as file:
        for name in table.columns:
            dataset = file.create_dataset(name, data=table[name].to_numpy()[None, :])
            dataset.attrs["MATLAB_class"] = np.bytes_("double")
        group = file.create_group("units")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, unit in units.items():
            text = np.array([[ord(letter)] for letter in unit], dtype=np.uint16)
            group.create_dataset(name, data=text).attrs["MATLAB_class"] = np.bytes_("char")
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Sat Mar 14 08:15:00 2026 HDF5 schema 1.00 ."
    with path.open("r+b") as raw:
        raw.write(header.ljust(116) + bytes(8) + b"\x00\x02IM")


def write_mdf4(path: Path, table: pd.DataFrame, units: Mapping[str, str]) -> None:
    """Write one channel group; the column ``time`` is its master."""
    time = table["time"].to_numpy()
    signals = [
        Signal(table[name].to_numpy(), time, name=str(name), unit=units.get(str(name), ""))
        for name in table.columns
        if name != "time"
    ]
    with MDF(version="4.10") as file:
        file.append(signals, comment="bench")
        # asammdf insists on its own ending.
        saved = file.save(path.with_name(f"{path.name}.mf4"), overwrite=True)
    saved.replace(path)


def write_tdms(path: Path, table: pd.DataFrame, units: Mapping[str, str]) -> None:
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [
                ChannelObject(
                    "bench", name, table[name].to_numpy(), properties={"unit_string": units.get(str(name), "")}
                )
                for name in table.columns
            ]
        )


def write_hdf5(path: Path, table: pd.DataFrame, units: Mapping[str, str]) -> None:
    with h5py.File(path, "w") as file:
        for name in table.columns:
            dataset = file.create_dataset(name, data=table[name].to_numpy(), compression="gzip", shuffle=True)
            if name in units:
                dataset.attrs["unit"] = units[str(name)]


def write_parquet(path: Path, table: pd.DataFrame, units: Mapping[str, str]) -> None:
    """Write several row groups; units stand in the fields' metadata."""
    arrow = pa.Table.from_pandas(table)
    fields = [field.with_metadata({"unit": units[field.name]} if field.name in units else {}) for field in arrow.schema]
    schema = pa.schema(fields, metadata=arrow.schema.metadata)
    pq.write_table(arrow.cast(schema), path, row_group_size=max(1, len(table) // 3))


def write_excel(path: Path, table: pd.DataFrame, units: Mapping[str, str]) -> None:
    """Write one sheet with names and a line of units."""
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    for row in (list(table.columns), [units.get(name, "") for name in table.columns], *table.to_numpy().tolist()):
        sheet.append(row)
    book.save(path)


@dataclass(frozen=True)
class Sample:
    """A file that the contract tests of every format write."""

    format: str  # The name of its format
    write: Callable[[Path, pd.DataFrame, Mapping[str, str]], None]
    rounding: float = 0.0  # By how much a value may differ once it is read back, as a share of it

    def channel(self, name: str, unit: str) -> str:
        """Return what a channel is called in the file: text has the unit in its name."""
        return f"{name} [{unit}]" if self.format == "csv" else name


SAMPLES = {
    "csv": Sample("csv", write_csv),
    "tsv": Sample("csv", partial(write_csv, delimiter="\t")),
    "decimal_comma": Sample("csv", write_decimal_comma),
    "csv_gz": Sample("csv", write_csv_gz),
    "matlab5": Sample("matlab", write_matlab5),
    "matlab73": Sample("matlab", write_matlab73),
    "mdf4": Sample("mdf", write_mdf4),
    "tdms": Sample("tdms", write_tdms),
    "hdf5": Sample("hdf5", write_hdf5),
    "parquet": Sample("parquet", write_parquet),
    "excel": Sample("excel", write_excel, rounding=1e-15),  # openpyxl writes 16 digits
}
"""Samples of every format, by the name of what they are."""


def write_sample(kind: str, path: Path, rows: int = 400) -> pd.DataFrame:
    """Write a sample of the ``synthetic`` recording; return its table."""
    table, units = synthetic(rows)
    SAMPLES[kind].write(path, table, units)
    return table
