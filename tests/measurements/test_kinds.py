"""What is no recording is refused, saying what it is and what to do; what may be one is not."""

import gzip
import io
import pickle
import tarfile
import zipfile

import pytest

from clutchid.errors import DataError
from clutchid.measurements.formats.kinds import ENOUGH, kind_of, refusal
from clutchid.measurements.look import look
from clutchid.measurements.opening import open_source
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_kinds")

DBC = 'VERSION "1.0"\n\nNS_ :\n\nBU_: ECU\nBO_ 256 Clutch: 8 ECU\n SG_ Pos : 0|16@1+ (0.01,0) [0|100] "mm" ECU\n'
FOREIGN = {
    "lfs.mf4": (b"version https://git-lfs.github.com/spec/v1\noid sha256:12\n", "Git LFS pointer.*git lfs pull"),
    "bus.dbc": (DBC.encode(), "DBC database; name the recording of the bus, and give its DBC with --dbc"),
    "remarks.dbc": (b"// made by hand\n" + DBC.partition("\n")[2].encode(), "DBC database.*--dbc"),
    "bus.arxml": (b'<?xml version="1.0"?>\n<AUTOSAR xmlns="http://autosar.org/4.0">', "ARXML or KCD database.*--dbc"),
    "bus.kcd": (b'<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0">', "ARXML or KCD database.*--dbc"),
    "bus.sym": (b'FormatVersion=6.0 // Do not edit this line!\nTitle="bus"\n', "SYM database.*--dbc"),
    "page.csv": (b"<!DOCTYPE html>\n<html><head>", "web page.*download"),
    "any.xml": (b'<?xml version="1.0"?><measurement>', "XML file.*export"),
    "run.json": (b'{"time": [0, 1], "position": [0, 1]}', "JSON file.*CSV"),
    "ecu.a2l": (b'ASAP2_VERSION 1 60\n/begin PROJECT ecu ""', "A2L description"),
    "run.crtd": (b"1714564800.250000 1R11 100 01 02\n", "CRTD log of frames; convert it to BLF or ASC"),
    "run.can": (b"//----\n// Microchip Technology Inc.\n", "log of Microchip's CAN analyzer; convert it"),
    "pgn.csv": (b"CSV CAN data\nTime;Channel;PGN;Flags;DLC;Data0\n", "table of frames; convert it to BLF or ASC"),
    "run.raw": (b"|CF,2,1,1;|CK,1,3,1,1;\r\n|NO,1,8\0\0", "imc FAMOS file; export"),
    "run.pkl": (pickle.dumps({"time": [0.0]}), "pickle of Python; write its columns as Parquet or CSV"),
    "head.dat": (b"DIAEXTENDED  {@:ENGLISH\n#BEGINGLOBALHEADER\n", "header of DIAdem, whose samples.*export"),
    "run.7z": (b"7z\xbc\xaf\x27\x1c\0\4", "7-Zip archive; unpack"),
    "run.xz": (b"\xfd7zXZ\x00\0", "XZ archive; unpack"),
    "run.zst": (b"\x28\xb5\x2f\xfd\0\0", "Zstandard archive; unpack"),
    "run.tdms": (b"TDSm\x0e\0\0\0", "TDMS file"),
    "run.xls": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1\0", "Excel workbook.*CSV UTF-8"),
    "run.npy": (b"\x93NUMPY\1\0", "NumPy array"),
    "run.feather": (b"ARROW1\0\0", "Arrow .Feather. file; write it as Parquet"),
    "run.pcap": (b"\xd4\xc3\xb2\xa1\2\0\4\0" + bytes(16), "capture of Wireshark or tcpdump; write the frames as text"),
}


def archive(*names: str) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as packed:
        for name in names:
            packed.writestr(name, "0,1\n")
    return file.getvalue()


def tape() -> bytes:
    file = io.BytesIO()
    with tarfile.open(fileobj=file, mode="w") as packed:
        packed.addfile(tarfile.TarInfo("run.csv"))
    return file.getvalue()


FOREIGN |= {
    "logs.zip": (archive("run.mf4", "other.mf4"), r"ZIP archive \(of 'run.mf4' and 1 more\); unpack"),
    "sheet.xlsx": (archive("[Content_Types].xml", "xl/workbook.xml"), "Excel workbook; save the sheet as CSV"),
    "cut.zip": (archive("run.mf4")[:40], "damaged ZIP archive"),
    "logs.tar": (tape(), "tar archive; unpack"),
    "logs.tar.gz": (gzip.compress(tape()), "tar archive; unpack"),
    "bus.dbc.gz": (gzip.compress(DBC.encode()), "DBC database"),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_a_file_that_is_no_recording_is_refused_by_what_it_is(name, tmp_path):
    content, sentence = FOREIGN[name]
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(DataError, match=f"{name}: is an? (damaged )?.*{sentence}"):
        open_source(path)
    with pytest.raises(DataError, match=name):
        look(path)


@pytest.mark.parametrize("text", CASES["a_table_of_text_is_never_refused_for_its_beginning"])
def test_a_table_of_text_is_never_refused_for_its_beginning(text, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(text)
    assert refusal(text.encode(), path) == ""
    assert kind_of(text.encode()) == "csv"


def test_databases_of_other_projects_are_refused_as_recordings(data):
    files = [path for path in sorted(data("foreign_files/dbc").iterdir()) if path.is_file()]
    assert files
    assert [path.name for path in files if not refusal(path.read_bytes()[:ENOUGH], path)] == []
