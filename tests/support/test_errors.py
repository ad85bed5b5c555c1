from cranectl.support.errors import InputError, nearest_first, unknown_name


def test_message_has_found_allowed_remedy() -> None:
    text = str(InputError("a", allowed="b", remedy="c"))
    assert text == "found:   a\nallowed: b\nremedy:  c"
    assert str(InputError("a")) == "found:   a"


def test_nearest_first_breaks_ties_by_name() -> None:
    assert nearest_first("lqr", ["zzz", "pole-placement", "lqr", "aaa"])[0] == "lqr"
    assert nearest_first("q", ["bb", "aa"]) == ["aa", "bb"]


def test_unknown_name_only_guesses_what_is_near() -> None:
    assert "did you mean 'lqr'" in unknown_name("controller", "lq", ["lqr", "pole-placement"]).remedy
    assert "did you mean" not in unknown_name("controller", "xyz", ["lqr", "pole-placement"]).remedy
