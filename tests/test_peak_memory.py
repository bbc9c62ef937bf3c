"""What tests of memory measure with."""

from peak_memory import peak_growth_kb


def test_memory_of_code_is_seen_also_where_the_process_that_starts_it_took_more():
    taken = b"x" * 300_000_000
    assert 140_000 < peak_growth_kb("", 'b"x" * 150_000_000') < 170_000
    assert len(taken) == 300_000_000
