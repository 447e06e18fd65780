"""Checkpoints: sealed, checked whole before use, one line where they are not what a run can have written."""

import dataclasses
import hashlib
import io
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.train
torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

from benchmarks import fuzz  # noqa: E402
from tests.learning.fakes import FakeWiping, camera_homography, sample_masks  # noqa: E402

from contactsafe.core.errors import InvalidInputError, OutputError  # noqa: E402
from contactsafe.core.files import held  # noqa: E402
from contactsafe.learning.algorithms import PpoConfig, SacConfig  # noqa: E402
from contactsafe.learning.checkpoints import (  # noqa: E402
    CHECKPOINT,
    load_checkpoint,
    save_checkpoint,
)
from contactsafe.learning.curves import EventFile  # noqa: E402
from contactsafe.learning.encoder import EncoderConfig  # noqa: E402
from contactsafe.learning.packing import pack, unpack  # noqa: E402
from contactsafe.learning.run_settings import as_started  # noqa: E402
from contactsafe.learning.train_policy import train_policy  # noqa: E402
from contactsafe.learning.train_vae import VaeConfig, train_vae  # noqa: E402

ROOT = Path(__file__).parents[2]
SMALL = {"num_envs": 4, "rollout_steps": 8, "batch": 16, "net": (8, 8), "evaluate_episodes": 0, "total_steps": 64}
CONFIGS = {
    "ppo": PpoConfig(epochs=1, **SMALL),
    "sac": SacConfig(buffer=128, learning_starts=16, update_every=4, gradient_steps=1, action_repeat=1, **SMALL),
}


@pytest.fixture(autouse=True, scope="module")
def no_bundles():
    """Leave out what comes after training."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("contactsafe.learning.train_policy.export_bundle", lambda *args, **options: None)
        yield


@pytest.fixture(scope="module")
def finished(encoder, tmp_path_factory):
    """Runs of both algorithms: their files."""
    files = {}
    for name, config in CONFIGS.items():
        out = tmp_path_factory.mktemp(name) / "run"
        train_policy(dataclasses.replace(config, encoder=encoder, out=out), FakeWiping)
        files[name] = {path.name: path.read_bytes() for path in out.iterdir()}
    return files


@pytest.fixture
def run(finished, encoder, tmp_path):
    """Put a finished run into a folder; gives the config with which it goes on."""

    def put(name):
        out = tmp_path / "run"
        out.mkdir()
        for file, data in finished[name].items():
            (out / file).write_bytes(data)
        return dataclasses.replace(CONFIGS[name], encoder=encoder, out=out, resume=True, total_steps=96)

    return put


def refusal(config):
    """Return what is said of a run that cannot go on, less its path; nothing in its folder may change."""
    before = {path: path.read_bytes() for path in config.out.iterdir()}
    with pytest.raises(InvalidInputError) as error:
        train_policy(config, FakeWiping)
    assert {path: path.read_bytes() for path in config.out.iterdir() if path.name != "training.lock"} == {
        path: data for path, data in before.items() if path.name != "training.lock"
    }
    text = str(error.value)
    assert "\n" not in text
    assert len(text) < 400
    return text.removeprefix(f"{config.out}/checkpoint.pt ")


def test_a_run_goes_on_from_a_whole_checkpoint(run):
    config = run("ppo")
    train_policy(config, FakeWiping)
    assert load_checkpoint(config.out)["counters"]["num_timesteps"] == 96


@pytest.mark.parametrize("place", [0, 40, 100, 5000, -1])
def test_a_flipped_bit_is_refused(run, place):
    config = run("ppo")
    data = bytearray((config.out / CHECKPOINT).read_bytes())
    data[place] ^= 4
    (config.out / CHECKPOINT).write_bytes(data)
    assert refusal(config) in (
        "is damaged (its SHA-256 differs); start anew with another --out",
        "cannot be read as a checkpoint; start anew with another --out",
    )


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04", bytes(1000), b"contactsafe checkpoint sha256 \n"])
def test_what_is_no_checkpoint_is_refused(run, data):
    config = run("ppo")
    (config.out / CHECKPOINT).write_bytes(data)
    assert refusal(config) == "cannot be read as a checkpoint; start anew with another --out"


def sealed(data):
    return f"contactsafe checkpoint sha256 {hashlib.sha256(data).hexdigest()}\n".encode() + data


def test_an_archive_that_unpacks_to_more_than_it_is_is_refused(run):
    config = run("ppo")
    body = io.BytesIO()
    with zipfile.ZipFile(body, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", bytes(10_000_000))
    (config.out / CHECKPOINT).write_bytes(sealed(body.getvalue()))
    assert refusal(config) == "cannot be read as a checkpoint; start anew with another --out"


def test_a_checkpoint_that_would_run_code_is_refused(run, tmp_path):
    class Code:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "owned"),)

    config = run("ppo")
    body = io.BytesIO()
    torch.save({"format": 5, "code": Code()}, body)
    (config.out / CHECKPOINT).write_bytes(sealed(body.getvalue()))
    assert refusal(config) == "cannot be read as a checkpoint; start anew with another --out"
    assert not (tmp_path / "owned").exists()


def change(config, alter):
    """Alter the state of a checkpoint and seal it with the right digest."""
    state = load_checkpoint(config.out)
    state["env"] = unpack(state["env"])
    alter(state)
    if isinstance(state.get("env"), dict):
        state["env"] = pack(state["env"])
    save_checkpoint(config.out, state)
    return refusal(config)


@pytest.mark.parametrize(
    "key", ["algorithm", "config", "encoder", "task", "minutes", "parameters", "variables", "counters", "episodes",
            "successes", "random", "random_actions", "replay_rows", "env"],
)  # fmt: skip
def test_a_missing_key_is_told_by_its_name(run, key):
    told = change(run("ppo"), lambda state: state.pop(key))
    assert told == f"is damaged: {key} is missing; start anew with another --out"


def first(state, name):
    return next(iter(state["parameters"][name].values()))


ALTERED = {
    "nan weights": (
        lambda s: first(s, "policy").fill_(float("nan")),
        "is damaged: parameters.policy.log_std is not finite; start anew with another --out",
    ),
    "weights of another shape": (
        lambda s: s["parameters"]["policy"].update(log_std=torch.zeros(5)),
        "is damaged: parameters.policy.log_std has shape (5,), not (18,); start anew with another --out",
    ),
    "a view of a petabyte": (
        lambda s: s["parameters"]["policy"].update(log_std=torch.zeros(1).expand(2**50)),
        "is damaged: parameters.policy.log_std has shape (1125899906842624,), not (18,); start anew",
    ),
    "an optimiser of other parameters": (
        lambda s: s["parameters"]["policy.optimizer"]["state"].update({10**9: {}}),
        "is damaged: parameters.policy.optimizer.state[1000000000] is {}, of no parameter; start anew",
    ),
    "negative steps": (
        lambda s: s["parameters"]["policy.optimizer"]["state"][0]["step"].fill_(-5.0),
        "is damaged: parameters.policy.optimizer.state[0].step is negative; start anew",
    ),
    "a counter of 1e30": (
        lambda s: s["counters"].update(num_timesteps=10**30),
        "is damaged: num_timesteps = 1000000000000000000000000000000 is outside [0, 9007199254740992]; start anew",
    ),
    "NumPy's generator at place 1e9": (
        lambda s: s["random"]["numpy"].__setitem__(2, 10**9),
        "is damaged: random.numpy is not a state of its generator; start anew",
    ),
    "Python's generator at place 1e9": (
        lambda s: s["random"]["python"][1].__setitem__(-1, 10**9),
        "is damaged: random.python is not a state of its generator; start anew",
    ),
    "torch's generator full of 255": (
        lambda s: s["random"]["torch"].fill_(255),
        "is damaged: random.torch is not a state of its generator; start anew",
    ),
    "an observation of another shape": (
        lambda s: s["env"].update(observation=np.zeros((4, 3), np.float32)),
        "is damaged: observation is float32 of shape (4, 3), or not finite; start anew",
    ),
    "a setting of 900,000 digits": (
        lambda s: s["config"].update(seed="9" * 900_000),
        None,
    ),
    "a setting that is a tensor": (
        lambda s: s["config"].update(seed=torch.zeros(2)),
        "is damaged: config is {",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", ALTERED)
def test_what_no_run_can_have_written_is_refused(run, what):
    alter, expected = ALTERED[what]
    told = change(run("ppo"), alter)
    assert expected is None or told.startswith(expected)


def craft(config, alter):
    """Alter the packed worlds of a checkpoint."""
    state = load_checkpoint(config.out)
    alter(state["env"])
    save_checkpoint(config.out, state)
    return refusal(config)


def text_with(**fields):
    def alter(packed):
        value = json.loads(packed["text"])
        value["observation"].update(fields)
        packed["text"] = json.dumps(value)

    return alter


@pytest.mark.parametrize(
    "alter",
    [
        text_with(piece=10**9),
        text_with(piece=-3),
        text_with(shape=[2**40, 2**40]),
        text_with(shape=[-1]),
        text_with(dtype="|O"),
        text_with(dtype="<U400"),
        text_with(dtype="x" * 10_000),
        lambda packed: packed.update(ends=[0, 10**9, 5]),
        lambda packed: packed.update(ends=["x"]),
        lambda packed: packed.update(text="[" * 100_000),
        lambda packed: packed.update(text="9" * 900_000),
        lambda packed: packed.update(data=torch.zeros(3)),
        lambda packed: packed.pop("data"),
    ],
)
def test_an_index_of_1e9_in_the_packed_worlds_is_refused(run, alter):
    assert craft(run("ppo"), alter).startswith("is damaged: ")


def test_a_flipped_bit_in_the_memory_is_refused(run):
    config = run("sac")
    data = bytearray((config.out / "replay.bin").read_bytes())
    data[len(data) // 3] ^= 1
    (config.out / "replay.bin").write_bytes(data)
    assert refusal(config).endswith("is damaged; start anew with another --out")


@pytest.mark.parametrize("rows", [10**9, -1, 2**70, 1.5])
def test_rows_of_the_memory_that_were_never_written_are_refused(run, rows):
    told = change(run("sac"), lambda state: state.update(replay_rows=rows))
    assert told.endswith("; start anew with another --out")


def test_a_run_of_another_session_that_is_no_dict_gives_no_settings(run):
    config = run("ppo")
    state = load_checkpoint(config.out)
    for wrong in ({"net": "x"}, {"encoder": []}, {"num_envs": "4"}, {"observes": 3}, {"num_envs": -1}):
        save_checkpoint(config.out, {**state, "config": {**state["config"], **wrong}})
        try:
            as_started(config)
        except InvalidInputError as error:
            assert "\n" not in str(error)  # noqa: PT017 -- what is harmless need not be refused
    save_checkpoint(config.out, {**state, "config": 3})
    with pytest.raises(InvalidInputError, match="is damaged: config is 3, not dict; start anew with another --out"):
        as_started(config)


VAE = VaeConfig(
    representation="tool",
    encoder=EncoderConfig(size=32, channels=(4, 4, 8)),
    images=32,
    held_out=8,
    epochs=1,
    batch=16,
    probe_steps=0,
)


@pytest.mark.parametrize(
    ("alter", "expected"),
    [
        (lambda s: s.pop("optimiser"), "optimiser is missing"),
        (lambda s: s["model"].popitem(), "model is not what it should hold (missing: ['decoder.8.bias'])"),
        (lambda s: next(iter(s["model"].values())).fill_(float("inf")), "model.encoder.0.weight is not finite"),
        (lambda s: s.update(epochs_done=-1), "epochs_done = -1 is outside [0, 9007199254740992]"),
        (lambda s: s.update(epochs_done=True), "epochs_done is True, not int"),
    ],
)
def test_an_encoder_that_goes_on_from_what_cannot_be_is_refused(encoder, tmp_path, alter, expected):
    config = dataclasses.replace(VAE, out=tmp_path)
    state = load_checkpoint(encoder)
    state["config"].update(images=32, held_out=8)
    alter(state)
    save_checkpoint(tmp_path, state)
    with pytest.raises(InvalidInputError) as error:
        train_vae(dataclasses.replace(config, resume=True), sample_masks, camera_homography())
    text = f"{tmp_path}/checkpoint.pt is damaged: {expected}; start anew with another --out"
    assert str(error.value) == text


def test_the_second_training_in_a_folder_is_refused_and_told_who_the_first_is(run, encoder, tmp_path):
    config = run("ppo")
    before = load_checkpoint(config.out)["counters"]
    with held(config.out):
        for resume in (True, False):
            with pytest.raises(OutputError, match=rf"run is in use by process {os.getpid()} on .*, since 20"):
                train_policy(dataclasses.replace(config, resume=resume), FakeWiping)
        with pytest.raises(OutputError, match=r"run is in use by process"):
            train_vae(VaeConfig(out=config.out, held_out=4), sample_masks, camera_homography())
    assert load_checkpoint(config.out)["counters"] == before
    train_policy(config, FakeWiping)


TRAIN_ON_A_FULL_DISK = """
import pickle, resource, sys
from pathlib import Path
from contactsafe.core.errors import ContactSafeError
from contactsafe.learning.train_policy import train_policy
from tests.learning.fakes import FakeWiping
config = pickle.loads(Path(sys.argv[1]).read_bytes())
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    train_policy(config, FakeWiping)
except ContactSafeError as error:
    print(error)
"""


@pytest.mark.parametrize(
    ("name", "limit", "file"), [("ppo", 20_000, "checkpoint.pt"), ("sac", 100_000, "replay.bin"), ("ppo", 10, "config")]
)
def test_a_file_size_limit_met_in_training_is_one_line_and_the_checkpoint_whole(run, name, limit, file, tmp_path):
    import pickle

    config = run(name)
    before = (config.out / CHECKPOINT).read_bytes()
    assert len(before) > 20_000
    (tmp_path / "job").write_bytes(pickle.dumps(config))
    command = [sys.executable, "-c", TRAIN_ON_A_FULL_DISK, str(tmp_path / "job"), str(limit)]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert ended.returncode == 0, ended.stderr[-2000:]
    assert "Traceback" not in ended.stderr
    (line,) = ended.stdout.splitlines()
    assert line.startswith(f"cannot write {config.out}/{file}")
    assert line.endswith(": File too large; make room")
    assert (config.out / CHECKPOINT).read_bytes() == before


def test_curves_on_a_full_disk_are_told_where_they_are_written(tmp_path, monkeypatch):
    log = EventFile(tmp_path)
    monkeypatch.setattr(log._writer, "_writer", open("/dev/full", "wb", buffering=0))  # noqa: SIM115
    with pytest.raises(OutputError, match=r"^cannot write .*tfevents.*: No space left on device; make room$"):
        log.write({"a": 1.0}, 1)
    log._writer._writer.close()
    log.close()


@pytest.mark.slow
def test_damage_of_every_kind_is_refused_or_harmless():
    """A slice of `benchmarks/fuzz.py`, which has the long campaign; on the real task, in a process of its own."""
    results = list(fuzz.in_batches("checkpoints", 1, 30))
    assert [result for result in results if result[2] not in ("refused", "harmless")] == []
    assert sum(outcome == "refused" for *_, outcome in results) > 10
