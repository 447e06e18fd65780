"""Damage bundles and checkpoints in all manners, and see that each is refused in one line or harmless.

    python benchmarks/fuzz.py [--bundles 600] [--checkpoints 150] [--seed 0]

Every batch runs in a process of its own, so that a crash is seen and costs no more than its batch. Item i of a seed
is the same in every run.
"""

import argparse
import collections
import copy
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from contactsafe.core.errors import ContactSafeError
from contactsafe.policy import onnx_graph
from contactsafe.policy.bundle import POLICY, blank_observation, shipped_bundle
from contactsafe.policy.manifest import MANIFEST, digest
from contactsafe.policy.operators import RULES
from contactsafe.policy.policy import Policy

BATCH = 50
SECONDS = 20.0
"""Longest that one item may take."""

LONGEST_LINE = 600

HOMOGRAPHY = np.array([[3.0, 0.2, 4.0], [0.1, 3.0, 5.0], [0.001, 0.002, 1.0]])

ADVERSARIAL = (
    None, True, -1, 0, 1, 2**31, 2**62, 10**4000, -1e308, float("nan"), float("inf"), "", "x" * 900_000, "../../x",
    "\n", [], {}, [[]], {"a": {"a": {}}}, [0] * 1000,
)  # fmt: skip
"""Values that stand in a place of others."""


# -- bundles ----------------------------------------------------------------------------------------------------------


def damage_bundle(folder: Path, rng: random.Random) -> str:
    """Damage one bundle; return the name of the damage."""
    damage = rng.choice(BUNDLE_DAMAGES)
    damage(folder, rng)
    return damage.__name__.strip("_")


def _flip_bits(folder, rng):
    path = folder / rng.choice((MANIFEST, POLICY))
    data = bytearray(path.read_bytes())
    for _ in range(rng.choice((1, 1, 10, 1000))):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path.write_bytes(data)
    if rng.random() < 0.7:
        _reseal(folder)


def _cut_or_grow(folder, rng):
    path = folder / rng.choice((MANIFEST, POLICY))
    data = path.read_bytes()
    cut = data[: rng.randrange(len(data))]
    path.write_bytes(rng.choice((cut, cut + cut, b"", data + rng.randbytes(100), rng.randbytes(1000), data + data)))
    if rng.random() < 0.7:
        _reseal(folder)


def _change_manifest(folder, rng):
    manifest = json.loads((folder / MANIFEST).read_text())
    place, key = rng.choice(list(_places(manifest)) if rng.random() < 0.3 else [(manifest, name) for name in manifest])
    if rng.random() < 0.2:
        del place[key]
    else:
        place[key] = copy.deepcopy(rng.choice(ADVERSARIAL))
    _write(folder, manifest)


def _break_json(folder, rng):
    text = (folder / MANIFEST).read_text()
    broken = (
        "[" * 100_000, text.replace("{", '{"format": 3, ', 1), text[:-2] + ', "format": 3}', "null", "1" * 900_000,
        text.replace("0.64", "9" * 900_000), text.replace("0.64", "1e999999"), text.encode("utf-16").decode("latin-1"),
        '{"a":' * 900 + "1" + "}" * 900,
    )  # fmt: skip
    (folder / MANIFEST).write_text(rng.choice(broken))


def _replace_file(folder, rng):
    path = folder / rng.choice((MANIFEST, POLICY))
    kept = folder.parent / "kept"
    path.rename(kept)
    damage = rng.randrange(6)
    if damage == 0:
        path.mkdir()
    elif damage == 1:
        os.mkfifo(path)
    elif damage == 2:
        path.symlink_to(kept)
    elif damage == 3:
        path.symlink_to(path)
    elif damage == 4:
        path.symlink_to("/dev/zero")
    else:
        with path.open("wb") as file:
            file.truncate(2**40)


def _change_graph(folder, rng):
    """Change a field of the model's file somewhere, and seal it anew."""
    model = onnx_graph._messages()["Model"]()
    model.ParseFromString((folder / POLICY).read_bytes())
    for _ in range(rng.choice((1, 1, 3))):
        _mutate(rng.choice(list(_messages_in(model))), rng)
    (folder / POLICY).write_bytes(model.SerializePartialToString())
    _reseal(folder)


def _add_operators(folder, rng):
    """Put operators into the graph that cost much, are not allowed, or make no sense."""
    model = onnx_graph._messages()["Model"]()
    model.ParseFromString((folder / POLICY).read_bytes())
    names = [name for node in model.graph.node for name in node.output]
    kind = rng.choice(
        (*RULES, "Loop", "If", "Scan", "Tile", "Expand", "ConstantOfShape", "Range", "Resize", "Gather", "Einsum")
    )
    value = rng.choice((*names, *(tensor.name for tensor in model.graph.initializer)))
    for k in range(rng.choice((1, 40, 300))):
        node = model.graph.node.add(op_type=kind, domain=rng.choice(("", "", "", "ai.onnx.ml", "com.microsoft")))
        node.input.extend([value] * rng.choice((1, 2, 2, 3, 100)))
        value = f"grown{k}"
        node.output.extend([value, *([f"other{k}"] if rng.random() < 0.2 else [])])
        if rng.random() < 0.5:
            attribute = node.attribute.add(name=rng.choice(("axis", "to", "transB", "pads", "strides", "axes")), type=2)
            attribute.i = rng.choice((0, 1, -1, 2**62))
    if rng.random() < 0.5:
        model.graph.node[-1].output[0] = "action"
    (folder / POLICY).write_bytes(model.SerializePartialToString())
    _reseal(folder)


def _drop_ends(folder, rng):
    """Take all outputs or inputs from an operator, most often from one put in between."""
    model = onnx_graph._messages()["Model"]()
    model.ParseFromString((folder / POLICY).read_bytes())
    node = rng.choice(model.graph.node)
    if rng.random() < 0.7:
        node = model.graph.node.add(op_type=rng.choice(tuple(RULES)), input=[model.graph.input[0].name], output=["end"])
        node.attribute.add(name="axis", type=2).i = 1
    for ends in rng.choice(((node.output,), (node.output,), (node.input,), (node.output, node.input))):
        del ends[:]
    (folder / POLICY).write_bytes(model.SerializePartialToString())
    _reseal(folder)


def _add_unknown_fields(folder, rng):
    """Append what a reader of protobuf may merge, skip or take for something else."""
    data = (folder / POLICY).read_bytes()
    field, kind = rng.choice((7, 8, 14, 20, 25, 1000)), rng.choice((0, 1, 2, 3, 5))
    body = rng.choice((data, b"", rng.randbytes(20)))
    head = _varint(field << 3 | kind)
    tail = head + (_varint(len(body)) + body if kind == 2 else rng.randbytes(8))
    (folder / POLICY).write_bytes(data + tail)
    _reseal(folder)


BUNDLE_DAMAGES = (
    _flip_bits, _flip_bits, _cut_or_grow, _change_manifest, _change_manifest, _break_json, _replace_file, _change_graph,
    _change_graph, _change_graph, _add_operators, _add_operators, _drop_ends, _add_unknown_fields,
)  # fmt: skip


def _varint(number):
    out = b""
    while number > 127:
        out += bytes([number & 127 | 128])
        number >>= 7
    return out + bytes([number])


def _messages_in(message):
    yield message
    for field, value in message.ListFields():
        if field.type == field.TYPE_MESSAGE:
            for inner in value if field.is_repeated else [value]:
                yield from _messages_in(inner)


def _mutate(message, rng):
    field = rng.choice(message.DESCRIPTOR.fields)
    if field.type == field.TYPE_MESSAGE:
        if field.is_repeated and len(getattr(message, field.name)):
            items = getattr(message, field.name)
            if rng.random() < 0.5:
                del items[rng.randrange(len(items))]
            else:
                items.add().CopyFrom(rng.choice(items))
        else:
            message.ClearField(field.name)
        return
    values = {
        field.CPPTYPE_STRING: ("", "action", "state", "centre", "Loop", "x" * 10_000)
        if field.type == field.TYPE_STRING
        else (b"", b"\xff" * 100, rng.randbytes(64)),
        field.CPPTYPE_FLOAT: (float("nan"), float("inf"), -1e30, 0.0),
        field.CPPTYPE_INT32: (0, 1, 2, 3, 6, 7, 8, 11, 2**31 - 1, -1),
        field.CPPTYPE_INT64: (0, 1, -1, 2, 2**31, 2**62, -(2**62)),
    }[field.cpp_type]
    if not field.is_repeated:
        setattr(message, field.name, rng.choice(values))
    elif rng.random() < 0.7 and len(getattr(message, field.name)):
        items = getattr(message, field.name)
        items[rng.randrange(len(items))] = rng.choice(values)
    else:
        getattr(message, field.name).extend([rng.choice(values)] * rng.choice((1, 1, 10_000)))


def _places(value):
    """Go through every place of nested dicts and lists."""
    for key, inner in list(value.items() if isinstance(value, dict) else enumerate(value)):
        yield value, key
        if isinstance(inner, dict | list):
            yield from _places(inner)


def _reseal(folder):
    """Make the manifest fit the model again, where it can be read."""
    try:
        manifest = json.loads((folder / MANIFEST).read_text())
        data = (folder / POLICY).read_bytes()
        manifest["files"][POLICY] = {"bytes": len(data), "sha256": digest(data)}
        _write(folder, manifest)
    except (ValueError, TypeError, KeyError, RecursionError):
        pass


def _write(folder, manifest):
    sys.set_int_max_str_digits(0)
    (folder / MANIFEST).write_text(json.dumps(manifest))
    sys.set_int_max_str_digits(4300)


def try_bundle(folder: Path) -> None:
    """Load a bundle and let it act, as a robot would."""
    policy = Policy(folder, HOMOGRAPHY)
    rng = np.random.default_rng(0)
    seen = blank_observation(policy.bundle, 2)
    seen["mask"][rng.random(seen["mask"].shape) < 0.02] = 0
    seen |= {name: rng.normal(size=(2, size)) for name, size in policy.bundle.observes.items()}
    action = policy.act(seen)
    assert action.shape == (2, 18)
    assert np.isfinite(action).all()
    assert np.abs(action).max() <= 1.0


def bundles(seed: int, items: range):
    """Damage and try so many bundles; yield number, damage and what came of it."""
    for i in items:
        with tempfile.TemporaryDirectory() as place:
            folder = shutil.copytree(shipped_bundle("wiping"), Path(place) / "bundle")
            damage = damage_bundle(folder, random.Random(f"{seed} {i}"))
            yield i, damage, outcome(lambda folder=folder: try_bundle(folder))


# -- checkpoints ------------------------------------------------------------------------------------------------------


def checkpoints(seed: int, items: range):
    """Damage and try so many checkpoints of a small run on the real task; yield number, damage and what came of it."""
    import gymnasium
    import torch

    from contactsafe.learning.algorithms import PpoConfig, SacConfig
    from contactsafe.learning.checkpoints import CHECKPOINT, load_checkpoint, save_checkpoint
    from contactsafe.learning.packing import pack, unpack
    from contactsafe.learning.run import Run, load_run
    from contactsafe.learning.train_policy import encoded
    from contactsafe.learning.train_vae import VaeConfig, train_vae
    from contactsafe.learning.vision_encoder import VisionEncoder
    from contactsafe.tasks.base.pushes import Pushes
    from contactsafe.tasks.wiping.config import WipingConfig
    from contactsafe.tasks.wiping.randomisation import Randomisation

    def make_env():
        task = WipingConfig(randomisation=Randomisation.broad(), pushes=Pushes(), episode_s=1.0)
        return gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=2, config=task)

    def sample_masks(n, seed):
        rng = np.random.default_rng(seed)
        return np.where(rng.random((n, 128, 128)) < 0.02, 0, 255).astype(np.uint8), rng.uniform(0.3, 0.6, (n, 3))

    def set_up(kind, **more):
        config = kind(
            encoder=place / "vae", out=place / kind.algorithm, num_envs=2, rollout_steps=8, batch=8, net=(8, 8), **more
        )
        config.out.mkdir()
        env = encoded(make_env(), encoder, config)
        model = config.make_model(env)
        run = Run(config, model, env, encoder.digest)
        model.learn(24, log_interval=None)
        run.save(1.0)
        return config, run, load_checkpoint(config.out), (config.out / "replay.bin")

    def go_on(config, run):
        run.load_state_dict(load_run(config, encoder.digest))
        for _ in range(3):
            run.env.step(np.zeros((2, 18), np.float32))
        run.model.learn(8, log_interval=None, reset_num_timesteps=False)

    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        train_vae(VaeConfig(out=place / "vae", held_out=16), sample_masks, HOMOGRAPHY)
        encoder = VisionEncoder.load(place / "vae")
        runs = [
            set_up(PpoConfig, epochs=1),
            set_up(SacConfig, buffer=64, learning_starts=4, update_every=2, gradient_steps=1, action_repeat=1),
        ]
        for i in items:
            rng = random.Random(f"{seed} {i}")
            config, run, state, replay = rng.choice(runs)
            path = config.out / CHECKPOINT
            whole = path.read_bytes()
            memory = replay.read_bytes() if replay.exists() else None
            if rng.random() < 0.25:
                damage = "raw bytes"
                target = replay if memory and rng.random() < 0.3 else path
                data = bytearray(target.read_bytes())
                if rng.random() < 0.5:
                    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
                else:
                    del data[rng.randrange(len(data)) :]
                target.write_bytes(data)
            else:
                damage = "sealed anew"
                state = copy.deepcopy(state)
                state["env"] = unpack(state["env"])
                _corrupt(state, rng)
                if isinstance(state.get("env"), dict):
                    state["env"] = pack(state["env"])
                save_checkpoint(config.out, state)
            yield i, damage, outcome(lambda config=config, run=run: go_on(config, run))
            path.write_bytes(whole)
            if memory is not None:
                replay.write_bytes(memory)


def _corrupt(state, rng):
    """Change one leaf of a checkpoint's state, more often one of the worlds'."""
    import torch

    root = state if rng.random() < 0.4 else state["env"]
    places = [(place, key) for place, key in _places(root)]
    arrays = [(p, k) for p, k in places if isinstance(p[k], np.ndarray) and p[k].size]
    place, key = rng.choice(arrays if root is state["env"] and rng.random() < 0.8 else places)
    value = place[key]
    if rng.random() < 0.1 and isinstance(place, dict):
        del place[key]
    elif isinstance(value, np.ndarray) and rng.random() < 0.9:
        flat = value.reshape(-1)
        if value.dtype.kind in "iu":
            wild = np.array(rng.choice((10**9, -(10**9), 255, -1, 2**62)))
            flat[rng.randrange(value.size)] = wild.astype(value.dtype)
        elif value.dtype.kind == "f":
            flat[rng.randrange(value.size)] = rng.choice((np.nan, np.inf, -np.inf, 1e300, -1e9))
    elif isinstance(value, torch.Tensor) and rng.random() < 0.9:
        others = torch.full_like(value, 2**30), value.reshape(-1)[:1].clone(), torch.zeros(3), value * 0 - 1
        place[key] = rng.choice(others)
        if value.is_floating_point() and rng.random() < 0.5:
            place[key] = value * float("nan")
    else:
        place[key] = copy.deepcopy(rng.choice([value for value in ADVERSARIAL if value != 10**4000]))


# -- both -------------------------------------------------------------------------------------------------------------


def outcome(action) -> str:
    """Say what became of an action: refused in one line, harmless, or what is a fault."""
    signal.signal(signal.SIGALRM, _too_long)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        action()
    except ContactSafeError as error:
        text = str(error)
        short = "\n" not in text and len(text) <= LONGEST_LINE
        return "refused" if short else f"FAULT: {len(text)} characters, {text[:80]!r}"
    except BaseException as error:
        return f"FAULT: {type(error).__name__}: {str(error)[:200]}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    return "harmless"


def _too_long(number, frame):
    raise TimeoutError(f"over {SECONDS} s")


KINDS = {"bundles": bundles, "checkpoints": checkpoints}


def in_batches(kind: str, seed: int, count: int):
    """Run so many items in processes of their own; yield number, damage and outcome of each."""
    for start in range(0, count, BATCH):
        stop = min(count, start + BATCH)
        command = [sys.executable, __file__, "--run", kind, str(seed), str(start), str(stop)]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        found = [json.loads(line[5:]) for line in ended.stdout.splitlines() if line.startswith("item ")]
        yield from found
        if ended.returncode:
            at = found[-1][0] + 1 if found else start
            yield at, "?", f"FAULT: exit {ended.returncode} at item {at}: {ended.stderr[-300:]}"


def main() -> int:
    """Run all, print a table and every fault; exit status 1 where there is one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bundles", type=int, default=600)
    parser.add_argument("--checkpoints", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--run", nargs=4, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.run:
        kind, seed, start, stop = asked.run
        for item in KINDS[kind](int(seed), range(int(start), int(stop))):
            print("item", json.dumps(item), flush=True)
        return 0
    faults = 0
    for kind in KINDS:
        results = list(in_batches(kind, asked.seed, getattr(asked, kind)))
        table = collections.Counter((damage, result.partition(":")[0]) for _, damage, result in results)
        for (damage, result), number in sorted(table.items()):
            print(f"{kind:12s} {damage:20s} {result:10s} {number:5d}")
        for i, damage, result in results:
            if result.startswith("FAULT"):
                print(f"{kind} {i} {damage}: {result}")
                faults += 1
        print(f"{kind}: {len(results)} tried, {sum(r == 'refused' for *_, r in results)} refused, {faults} faults")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
