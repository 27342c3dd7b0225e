"""Shell completion: installed into a home folder of its own, and refused in sentences."""

from __future__ import annotations

import subprocess
import sys

import pytest

from fixtures.commands import called
from fixtures.programs import path_of

pytestmark = pytest.mark.slow


@pytest.fixture
def install(tmp_path, monkeypatch, command):
    """Install completion into a home folder of its own."""
    for name in ("SHELL", "ZSH_CUSTOM", "XDG_DATA_HOME", "BASH_VERSION"):
        monkeypatch.delenv(name, raising=False)
    for name in ("HOME", "USERPROFILE"):
        monkeypatch.setenv(name, str(tmp_path))
    return lambda *arguments: command("--install-completion", *arguments)


@pytest.mark.skipif(sys.platform == "win32", reason="bash")
def test_bash_completes_the_commands_and_options_after_a_new_start(install, tmp_path):
    process = install("--shell", "bash")
    assert process.returncode == 0, process.stderr
    (script,) = [path for path in tmp_path.rglob("clutchid") if path.is_file()]
    assert f"written: {script}" in process.stdout
    assert "bash" in process.stdout.splitlines()[-1]
    assert str(script) in (tmp_path / ".bashrc").read_text(encoding="utf-8")
    asked = f"source {script}; COMP_WORDS=(clutchid fit --sa); COMP_CWORD=2; _clutchid; echo ${{COMPREPLY[@]}}"
    shell = subprocess.run([path_of("bash"), "-c", asked], capture_output=True, text=True, timeout=30, check=True)
    assert shell.stdout.strip() == "--save"
    again = install("--shell", "bash")
    assert again.returncode == 0
    assert (tmp_path / ".bashrc").read_text(encoding="utf-8").count(str(script)) <= 2  # one line has it twice


def test_the_help_says_which_files_change(install, tmp_path):
    process = install("--help")
    text = " ".join(process.stdout.split())
    assert process.returncode == 0
    for words in ("Tab key", ".bashrc", "--shell", "zsh"):
        assert words in text
    assert not any(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="bash")
def test_a_home_that_cannot_hold_it_is_one_sentence(install, tmp_path):
    (tmp_path / ".local").write_text("a file")
    process = install("--shell", "bash")
    assert process.returncode == 2
    assert "the completion for bash was not installed" in process.stderr
    assert len(process.stderr.splitlines()) == 1


def test_an_unknown_shell_lists_the_known_ones(install, tmp_path):
    process = install("--shell", "nush")
    assert process.returncode == 2
    assert ("bash" in process.stderr, len(process.stderr.splitlines())) == (True, 1)


def test_a_shell_that_cannot_be_found_out_is_asked_for(monkeypatch, capsys):
    import cyclopts.completion.detect

    def nowhere():
        raise cyclopts.completion.detect.ShellDetectionError

    monkeypatch.setattr(cyclopts.completion.detect, "detect_shell", nowhere)
    assert called("--install-completion") == 2
    assert "clutchid --install-completion --shell bash" in capsys.readouterr().err
