"""Nothing that was found is lost, and nothing stale is believed."""

import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from bench.scores import score

import dvca_sumo
from dvca_sumo.bench.score import Score
from dvca_sumo.installation import folder
from dvca_sumo.store import Store, StoreError, key_of


def test_what_was_added_is_found_by_the_next_one(tmp_path: Path) -> None:
    Store(tmp_path / "deep" / "scores.jsonl", Score).add("a", score())
    again = Store(tmp_path / "deep" / "scores.jsonl", Score)
    assert again.find("a") == score()
    assert again.find("b") is None


def test_a_line_that_was_cut_off_is_forgotten_and_the_rest_kept(tmp_path: Path) -> None:
    path = tmp_path / "scores.jsonl"
    store = Store(path, Score)
    store.add("a", score())
    store.add("b", score("other"))
    path.write_bytes(path.read_bytes()[:-20])
    again = Store(path, Score)
    assert again.find("a") == score()
    assert again.find("b") is None
    again.add("b", score("other"))
    assert Store(path, Score).find("b") == score("other")


def test_a_file_of_something_else_is_named_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "scores.jsonl").write_text('{"key": 1}\n')
    with pytest.raises(StoreError, match=r"line 1 of .*scores\.jsonl is no Score"):
        Store(tmp_path / "scores.jsonl", Score)


def test_what_older_code_kept_in_another_form_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "scores.jsonl"
    path.write_text('{"key":"old","value":{"of":"another form"}}\n')
    store = Store(path, Score)
    store.add("new", score())
    again = Store(path, Score)
    assert again.find("new") == score()
    with pytest.raises(StoreError, match=r"what .*scores\.jsonl keeps under old is no Score"):
        again.find("old")


def test_a_place_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="results cannot be kept in"):
        Store(tmp_path / "file" / "scores.jsonl", Score)


def test_a_file_that_cannot_be_added_to_is_told_before_anything_is_asked(tmp_path: Path) -> None:
    (tmp_path / "scores.jsonl").symlink_to(tmp_path / "gone" / "scores.jsonl")
    with pytest.raises(StoreError, match=r"results cannot be kept in .*scores\.jsonl: No such file"):
        Store(tmp_path / "scores.jsonl", Score)


def test_an_answer_that_cannot_be_kept_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "scores.jsonl"
    store = Store(path, Score)
    path.unlink()
    path.mkdir()
    with pytest.raises(StoreError, match=r"results cannot be kept in .*scores\.jsonl: Is a directory"):
        store.add("a", score())


def test_a_kept_answer_that_is_no_text_is_named(tmp_path: Path) -> None:
    path = tmp_path / "scores.jsonl"
    Store(path, Score).add("a", score("perception.miss/cs1"))
    path.write_bytes(path.read_bytes().replace(b"perception.miss/cs1", b"perception.miss/\xff"))
    with pytest.raises(StoreError, match=r"keeps under a is no Score: Invalid UTF-8"):
        Store(path, Score).find("a")


def test_equal_questions_have_equal_keys_and_others_others() -> None:
    assert key_of([1, "a"]) == key_of([1, "a"])
    assert len({key_of([1, "a"]), key_of(["a", 1]), key_of([1, "b"])}) == 3


def test_what_other_versions_of_the_libraries_have_found_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    before = key_of(["question"])
    for library in ("numpy", "shapely", "sumolib"):
        with monkeypatch.context() as patch:
            patch.setattr("dvca_sumo.store.version", lambda name, own=library: "0" if name == own else version(name))
            assert key_of(["question"]) != before
    assert key_of(["question"]) == before


@pytest.mark.parametrize("edited", ["dvca_sumo/stack/planning/planner.py", "faults/perception.miss.toml"])
def test_what_other_code_or_another_fault_has_found_is_not_believed(edited: str, tmp_path: Path) -> None:
    """Who edits the driver or a fault and asks again in the same folder gets new answers."""
    copy = tmp_path / "dvca_sumo"
    shutil.copytree(folder("faults"), tmp_path / "faults")
    shutil.copytree(Path(dvca_sumo.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__", "faults"))

    def key() -> str:
        code = "from dvca_sumo.store import key_of; print(key_of(['question']))"
        words = [sys.executable, "-c", code]
        return subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True).stdout  # noqa: S603 ours

    before = key()
    assert key() == before
    with (tmp_path / edited).open("a") as file:
        file.write("\n")
    assert key() != before
