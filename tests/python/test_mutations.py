"""`bench mutations` in short: inputs with a few bytes changed are read, or refused in one line that names the file."""

import random

from bench_mutations import SEEDS, mutated, try_in_process


def test_changed_inputs_are_read_or_refused(tmp_path):
    counted, failures = try_in_process(250, 7, tmp_path)
    assert failures == []
    assert min(sum(count for (suffix, _), count in counted.items() if suffix == kind) for kind in SEEDS) > 5
    # Neither is all refused nor all read: the changes are small, and they matter.
    assert counted[".csv", "read"] > 0 and counted[".nml", "refused"] > 0


def test_changes_change():
    rng, content = random.Random(1), SEEDS[".nml"][0]
    assert sum(mutated(content, rng) != content for _ in range(50)) > 30
