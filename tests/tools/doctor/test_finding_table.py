"""The table of findings: complete, without a cycle, and with exactly the values that the code gives."""

import ast
from collections import defaultdict
from itertools import combinations
from pathlib import Path

import pytest

import fwav_companion.tools.doctor
from fwav_companion.tools.doctor.causes import CAUSES
from fwav_companion.tools.doctor.finding import Level
from fwav_companion.tools.doctor.finding_table import (
    FINDINGS,
    GROUPS,
    SHARED_PARTS,
    consequences_of,
    make_finding,
    names_in,
)
from fwav_companion.tools.reason_table import judged_reasons

DOCTOR = Path(fwav_companion.tools.doctor.__file__).parent
TESTS = [Path(__file__).parent, Path(__file__).parents[2] / "cli"]


def calls():
    """Code, constant cases, and names of the values, of every call of `make_finding`."""
    for path in DOCTOR.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "make_finding":
                cases = [each for case in node.args[1:] for each in constants(case)]
                yield ast.literal_eval(node.args[0]), cases, {keyword.arg for keyword in node.keywords}


def constants(case):
    """The constants that an expression may be; none where it is found out at run time."""
    both = [case.body, case.orelse] if isinstance(case, ast.IfExp) else [case]
    return [each.value for each in both if isinstance(each, ast.Constant)]


def fields_of(code):
    """Every text of a finding as the table has it, its parts and the shared ones that it uses included."""
    entry = FINDINGS[code]
    own = [entry.where, entry.problem, entry.fix, *entry.parts.values()]
    used = {name for field in own for name in names_of(field)}
    return own + [part for name, part in SHARED_PARTS.items() if name in used]


def names_of(field):
    """The names of values and parts in a field, in any case."""
    return {name for text in (field.values() if isinstance(field, dict) else [field]) for name in names_in(text)}


def every_code():
    return FINDINGS.keys() | {reason.value for things in ("frame", "detection") for reason in judged_reasons(things)}


def test_every_finding_gets_exactly_the_values_that_its_texts_use():
    given, needed = defaultdict(set), {}
    for code, _, names in calls():
        given[code] |= names
    for code, entry in FINDINGS.items():
        names = {name for field in fields_of(code) for name in names_of(field)}
        assert entry.parts.keys() <= names
        needed[code] = names - entry.parts.keys() - SHARED_PARTS.keys()
    assert given == needed


def test_every_constant_case_has_a_text_or_a_level():
    for code, cases, _ in calls():
        fields = [FINDINGS[code].level, *fields_of(code)]
        known = {case for field in fields if isinstance(field, dict) for case in field}
        assert "else" in known or set(cases) <= known, code


@pytest.mark.parametrize("code", FINDINGS)
def test_fields_of_a_finding_name_the_same_cases_or_have_none_in_common(code):
    fields = [FINDINGS[code].level, *fields_of(code)]
    named = [field.keys() for field in fields if isinstance(field, dict) and "else" not in field]
    assert all(one == other or not one & other for one, other in combinations(named, 2))


def test_every_finding_is_planted():
    trees = (ast.parse(path.read_text()) for folder in TESTS for path in folder.glob("test_*.py"))
    constants = (node.value for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant))
    assert every_code() - {constant for constant in constants if isinstance(constant, str)} == set()


def test_consequences_are_codes_that_exist():
    assert {*CAUSES, *(code for effects in CAUSES.values() for code in effects)} <= every_code()
    assert GROUPS.keys().isdisjoint(every_code())


def test_no_finding_is_its_own_cause():
    def below(code, above=()):
        assert code not in above, (*above, code)
        for effect in CAUSES.get(code, ()):
            below(effect, (*above, code))

    for code in CAUSES:
        below(code)


def test_a_group_has_the_findings_of_the_groups_that_it_names():
    assert consequences_of("", ("mount",)) < consequences_of("", ("slow",)) < consequences_of("", ("vehicle",))
    assert "attitude_slow" not in consequences_of("attitude_slow", ("slow",))


def test_a_finding_has_the_level_and_the_texts_of_its_cases():
    values = {"link": "a", "percent": 31, "bytes_in": 900}
    wire, radio = (
        make_finding("garbage", "no_peer", "serial", **values),
        make_finding("garbage", "peers", "udpin", **values),
    )
    assert (wire.level, radio.level) == (Level.ERROR, Level.WARNING)
    assert wire.where == radio.where == "link a"
    assert wire.problem == radio.problem == "31 % of 900 bytes are not MAVLink"
    assert "baud" in wire.fix
    assert "protocol" in radio.fix


def test_a_part_without_its_value_is_left_out():
    values = {"link": "a", "url": "udpin://:1", "why": "in use"}
    assert make_finding("port_taken", "gcs", holder=None, **values).problem == "udpin://:1 is in use (in use)"
    assert make_finding("port_taken", "gcs", holder="x", **values).problem == "udpin://:1 is in use by x (in use)"


@pytest.mark.parametrize(("cases", "values"), [((), {"path": "/x", "key": "k"}), (("mount",), {"path": "/x"})])
def test_a_case_or_a_value_that_is_missing_is_an_error(cases, values):
    with pytest.raises(KeyError):
        make_finding("read_only", *cases, **values)
