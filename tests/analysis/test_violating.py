import pytest

from analysis.scenes import breach, collision
from dvca_sumo.analysis.violating import is_same_family, principal
from dvca_sumo.violations import Category

CLOSE = breach("ttc", Category.SAFETY, 10.0, "lead")
FAST = breach("speed_limit", Category.TRAFFIC_RULE, 9.0)


def test_the_first_violation_is_explained() -> None:
    assert principal([FAST, collision(12.0)]) is FAST
    assert principal([collision(12.0), breach("safe_distance", Category.SAFETY, 13.0, "lead")]).kind == "collision"


@pytest.mark.parametrize("kind", ["ttc", "safe_distance"])
def test_a_close_call_that_ends_in_contact_is_that_contact(kind: str) -> None:
    contact = collision(12.0)
    assert principal([breach(kind, Category.SAFETY, 10.0, "lead"), FAST, contact]) is contact


def test_a_close_call_stands_for_itself_without_contact_with_that_object_soon_after() -> None:
    assert principal([CLOSE]) is CLOSE
    assert principal([CLOSE, collision(12.0, "other")]) is CLOSE
    assert principal([CLOSE, collision(16.1)]) is CLOSE
    assert principal([CLOSE, collision(15.9)]).kind == "collision"


def test_parts_of_what_is_drawn_are_one_object() -> None:
    close, contact = breach("ttc", Category.SAFETY, 10.0, "polygon:kerb#0"), collision(11.0, "polygon:kerb#1")
    assert principal([close, contact]) is contact
    assert principal([close, collision(11.0, "polygon:wall#1")]) is close


def test_close_calls_and_contacts_are_one_family_and_other_kinds_are_their_own() -> None:
    assert is_same_family("ttc", collision(1.0))
    assert is_same_family("collision", CLOSE)
    assert is_same_family("speed_limit", FAST)
    assert not is_same_family("ttc", FAST)
    assert not is_same_family("speed_limit", CLOSE)
