"""The mutations can still be made, and what is said of one that survives is true."""

import mutations
import pytest


@pytest.mark.parametrize("mutation", mutations.MUTATIONS, ids=[m.name for m in mutations.MUTATIONS])
def test_what_a_mutation_changes_is_there_once(mutation, tmp_path):
    for edit in mutation.edits:
        source, target = mutations.ROOT / "isetcl" / edit.file, tmp_path / "isetcl" / edit.file
        target.parent.mkdir(parents=True, exist_ok=True)
        if not target.exists():
            target.write_text(source.read_text())
        edit.apply(tmp_path)
        assert target.read_text() != source.read_text()
    for test in mutation.tests:
        file, name = test.split("::")
        assert f"def {name.split('[')[0]}(" in (mutations.ROOT / file).read_text()


def test_a_text_that_is_gone_is_said():
    edit = mutations.Edit("render/accumulate.py", "no such text", "anything")
    with pytest.raises(LookupError, match="has it 0 times"):
        edit.apply(mutations.ROOT)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("new", "verdict"), [("0.5", "caught"), ("1.0 + 0.0", "survived"), ("nonsense(", "broken")]
)
def test_verdicts(new, verdict):
    test = "tests/test_stats.py::test_levels_and_p_values_of_many_tests_are_inverses"
    old = "return -math.expm1(math.log1p(-alpha) / count) if alpha < 1.0 else 1.0"
    edit = mutations.Edit(
        "validation/stats/significance.py", old, old.replace("1.0 else 1.0", f"1.0 else {new}")
    )
    if verdict == "caught":
        edit = mutations.Edit("validation/stats/significance.py", old, "return alpha")
    made = mutations.Mutation("made up", "none", (edit,), (test,))
    assert mutations.attempt(made)[0] == verdict


def test_an_unknown_name_is_refused(capsys):
    assert mutations.main(["no such mutation"]) == 2
    assert "no mutation 'no such mutation'" in capsys.readouterr().out
