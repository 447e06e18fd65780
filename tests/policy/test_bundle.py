"""Bundles: exported, sealed, run; and what a damaged one is told."""

import json
import os
import shutil

import numpy as np
import pytest

pytestmark = pytest.mark.train
torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")

from benchmarks import fuzz  # noqa: E402
from tests.learning.fakes import camera_homography, sample_masks  # noqa: E402

from contactsafe.core.errors import BundleError, ContactSafeError, InvalidInputError, OutputError  # noqa: E402
from contactsafe.learning.encoder import VAE, EncoderConfig, MaskEncoder  # noqa: E402
from contactsafe.learning.export import export_bundle, export_encoder  # noqa: E402
from contactsafe.learning.onnx_models import DeployedPolicy, compare, to_onnx  # noqa: E402
from contactsafe.policy.bundle import Bundle  # noqa: E402
from contactsafe.policy.conditions import Conditions  # noqa: E402
from contactsafe.policy.manifest import MANIFEST, digest  # noqa: E402
from contactsafe.policy.observation import Observation, ObservationScaling  # noqa: E402
from contactsafe.policy.onnx_graph import read_graph  # noqa: E402
from contactsafe.policy.operators import RULES  # noqa: E402
from contactsafe.policy.policy import Policy  # noqa: E402
from contactsafe.vision.log_polar import FEATURES  # noqa: E402

H = camera_homography()
OBSERVED = {"pose": 6, "target": 18, "force": 3}
POSE = Observation("pose", (0.5, 0.0, 0.01, 0.0, 0.0, 0.0), (0.15, 0.15, 0.03, 0.1, 0.1, 0.1))


def listed(names):
    return [{"name": name, "size": OBSERVED[name]} for name in names]


DESCRIPTION = {
    "task": "wiping",
    "conditions": {"controller": "safe", "gains": "learned", "as_paper": False},
    "representation": "tool",
    "window_m": 0.64,
    "view_size": 32,
    "latent_size": 128,
    "observes": listed(["pose"]),
    "rate_hz": 60.0,
    "action_repeat": 1,
    "dither": {"amplitude": 0.0},
    "training": {},
    "results": {},
}


def networks():
    torch.manual_seed(0)
    layers = torch.nn.Sequential(torch.nn.Linear(134, 16), torch.nn.Tanh(), torch.nn.Linear(16, 18))
    torch.nn.init.normal_(layers[-1].weight, std=2.0)
    scaling = ObservationScaling.from_statistics([POSE], np.zeros(128), np.ones(128))
    return VAE(EncoderConfig(size=32, channels=(4, 4, 8))), layers, scaling


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bundle")
    vae, layers, scaling = networks()
    export_encoder(vae, folder / "encoder.onnx", 32)
    encoder = (folder / "encoder.onnx").read_bytes()
    return export_bundle(folder / "wiping", encoder, layers, scaling, DESCRIPTION)


@pytest.fixture
def bundle(exported, tmp_path):
    return shutil.copytree(exported, tmp_path / "bundle")


def observations(n=5, seed=1):
    masks, tools = sample_masks(n, seed)
    pose = np.zeros((n, 6), np.float32)
    pose[:, :3] = tools
    return {"pose": pose, "mask": masks[..., None]}


def refusal(folder):
    with pytest.raises(BundleError) as error:
        Bundle.load(folder)
    assert "\n" not in str(error.value)
    return str(error.value)


def reseal(folder, name):
    manifest = json.loads((folder / "bundle.json").read_text())
    data = (folder / name).read_bytes()
    manifest["files"][name] = {"bytes": len(data), "sha256": digest(data)}
    (folder / "bundle.json").write_text(json.dumps(manifest))


def rewrite(folder, **fields):
    manifest = {**json.loads((folder / "bundle.json").read_text()), **fields}
    (folder / "bundle.json").write_text(json.dumps(manifest))


def test_acts_as_the_trained_networks_do(exported):
    from contactsafe.vision.rectify import rectify

    vae, layers, scaling = networks()
    seen = observations()
    with torch.no_grad():
        views = torch.from_numpy(rectify(seen["mask"], seen["pose"], H, 0.64, 32))
        latent = MaskEncoder(vae)(views)
        scaled = torch.from_numpy(scaling(seen, latent.numpy()))
        wanted = layers(scaled).clamp(-1, 1).numpy()
    np.testing.assert_allclose(Policy(exported, H).act(seen), wanted, atol=1e-4)
    assert (np.abs(wanted) == 1.0).any()


def test_one_or_many_the_same_again_and_clipped(exported):
    policy, seen = Policy(exported, H), observations()
    actions = policy.act(seen)
    assert actions.shape == (5, 18)
    assert actions.dtype == np.float32
    assert np.abs(actions).max() <= 1.0
    np.testing.assert_array_equal(actions, policy.act(seen))
    for i in range(5):
        one = policy.act({key: value[i] for key, value in seen.items()})
        assert one.shape == (18,)
        np.testing.assert_allclose(one, actions[i], atol=1e-4)
    assert policy.rate_hz == 60.0


def test_a_policy_that_decided_every_third_step_holds_its_action_in_between(exported, bundle):
    manifest = json.loads((bundle / MANIFEST).read_text(encoding="utf-8"))
    (bundle / MANIFEST).write_text(json.dumps({**manifest, "action_repeat": 3}), encoding="utf-8")
    policy, every = Policy(bundle, H), Policy(exported, H)
    seen = [observations(seed=seed) for seed in range(6)]
    held = [policy.act(one) for one in seen]
    for k in range(6):
        np.testing.assert_array_equal(held[k], held[k - k % 3])
    np.testing.assert_allclose(held[0], every.act(seen[0]), atol=1e-4)
    policy.begin(1)  # its episode decides at once, the others when they would have
    again = policy.act(observations(seed=7))
    assert not np.array_equal(again[1], held[5][1])
    assert np.array_equal(policy.act(observations(seed=8))[1], again[1])


def test_camera_and_board_moved_with_a_new_calibration_change_nothing_but_the_pose(exported):
    """In the tool's frame the camera may stand elsewhere: the latent comes from board coordinates."""
    policy = Policy(exported, 3.0 * H)
    np.testing.assert_array_equal(policy.act(observations()), Policy(exported, H).act(observations()))


def test_bad_observations_are_refused(exported):
    policy, seen = Policy(exported, H), observations()
    with pytest.raises(InvalidInputError) as error:
        policy.act({**seen, "pose": np.zeros((5, 7))})
    assert str(error.value) == "pose has shape (5, 7) beside 5 masks; give (6,), or one a mask"
    seen["pose"][2, 1] = np.nan
    with pytest.raises(InvalidInputError) as error:
        policy.act(seen)
    assert str(error.value) == "pose is not finite; check the robot state before asking the policy"
    with pytest.raises(InvalidInputError):
        Policy(exported, np.zeros((3, 3)))


def log_polar_bundle(folder, observes):
    torch.manual_seed(0)
    k = sum(OBSERVED[name] for name in observes)
    layers = torch.nn.Sequential(torch.nn.Linear(k + FEATURES, 18))
    scaling = ObservationScaling(observes, (0.0,) * (k + FEATURES), (1.0,) * (k + FEATURES))
    encoder = {"representation": "log_polar", "view_size": 128, "latent_size": FEATURES}
    return export_bundle(folder, None, layers, scaling, {**DESCRIPTION, **encoder, "observes": listed(observes)})


def test_log_polar_needs_no_encoder_and_the_scale_of_a_homography_says_nothing(tmp_path):
    folder = log_polar_bundle(tmp_path / "bundle", ["pose"])
    assert sorted(path.name for path in folder.iterdir()) == ["bundle.json", "policy.onnx"]
    np.testing.assert_allclose(
        Policy(folder, H).act(observations()), Policy(folder, 3.0 * H).act(observations()), atol=1e-6
    )


def test_what_is_observed_besides_the_picture_is_asked_for(tmp_path):
    policy = Policy(log_polar_bundle(tmp_path / "bundle", ["pose", "target", "force"]), H)
    seen = {**observations(), "target": np.zeros((5, 18)), "force": np.zeros((5, 3))}
    moved = {**seen, "force": np.ones((5, 3))}
    assert np.abs(policy.act(seen) - policy.act(moved)).max() > 0.0
    del seen["force"]
    with pytest.raises(InvalidInputError) as error:
        policy.act(seen)
    assert str(error.value) == "observation has no force; this policy observes pose, target, force"


def test_the_motion_laid_over_the_actions_is_the_episodes_own(tmp_path):
    folder = log_polar_bundle(tmp_path / "bundle", ["pose"])
    rewrite(folder, dither={"amplitude": 0.25, "period_s": 1.0})
    still, policy, seen = Policy(log_polar_bundle(tmp_path / "still", ["pose"]), H), Policy(folder, H), observations(2)
    free = np.abs(still.act(seen)[:, :2]) < 0.75
    offsets = []
    for _ in range(60):
        offsets.append(policy.act(seen) - still.act(seen))
    policy.begin(1)
    assert not np.array(offsets)[:, :, 2:].any()
    assert 0.2 < np.abs(np.array(offsets)[:, :, :2][:, free]).max() <= 0.2501
    again = policy.act(seen) - still.act(seen)
    np.testing.assert_array_equal(again[1], offsets[0][1])
    rewrite(folder, dither={"amplitude": 2.0})
    assert refusal(folder) == f"{folder}/bundle.json: dither is {{'amplitude': 2.0}}; export the bundle anew"


def test_missing(bundle):
    assert refusal(bundle / "no") == (
        f"no bundle at {bundle}/no: not a folder; give the path of a folder that holds bundle.json"
    )
    (bundle / "policy.onnx").unlink()
    assert refusal(bundle) == f"{bundle}/policy.onnx is missing; the bundle is incomplete, copy or export it anew"


def test_one_bit_tampered(bundle):
    data = bytearray((bundle / "policy.onnx").read_bytes())
    data[len(data) // 2] ^= 1
    (bundle / "policy.onnx").write_bytes(data)
    assert refusal(bundle) == (
        f"{bundle}/policy.onnx is not the file bundle.json was written for (size or SHA-256 differ); "
        "copy or export the bundle anew"
    )


def test_too_large(bundle):
    with open(bundle / "encoder.onnx", "ab") as file:
        file.truncate(17_000_000)
    assert refusal(bundle) == (
        f"{bundle}/encoder.onnx has 17000000 bytes, at most 16000000 are allowed; this is not a bundle of ours"
    )


def test_manifest_damaged(bundle):
    path = bundle / "bundle.json"
    whole = path.read_text()
    path.write_text(whole[:100])
    assert refusal(bundle) == f"{path} is not JSON; the bundle is damaged, copy or export it anew"
    path.write_text("[" * 100_000)
    assert refusal(bundle) == f"{path} is not JSON; the bundle is damaged, copy or export it anew"
    path.write_text("[]")
    assert refusal(bundle) == f"{path} is not a JSON object; the bundle is damaged, copy or export it anew"
    path.write_text(whole)
    rewrite(bundle, format=99)
    assert refusal(bundle) == f"{path} has format 99, this version reads 5; export it anew, or upgrade"
    rewrite(bundle, format=5, rate_hz="60")
    assert refusal(bundle) == f"{path}: rate_hz is '60', not float; export the bundle anew"
    rewrite(bundle, rate_hz=60.0, window_m=float("nan"))
    assert refusal(bundle) == f"{path}: window_m = nan is outside [0.01, 10.0]; export the bundle anew"
    rewrite(bundle, window_m=0.64, observes=["pose", "truth"])
    assert refusal(bundle) == (
        f"{path}: observes is ['pose', 'truth'], not a list of names and sizes of vectors, each once; "
        "export the bundle anew"
    )
    rewrite(bundle, observes=listed(["pose"]), actions=["x"])
    assert refusal(bundle) == (
        f"{path}: actions are not those of this version's tasks; export the bundle anew, or upgrade"
    )


@pytest.mark.parametrize(
    "conditions", [{"gains": "soft"}, {"controller": 3}, {"as_paper": "no"}, {"speed": 1.0}, {"gains": ["low"]}]
)
def test_conditions_that_cannot_be(bundle, conditions):
    rewrite(bundle, conditions=conditions)
    told = f"{bundle}/bundle.json: conditions are {conditions}; export the bundle anew"
    assert refusal(bundle) == told


def test_a_bundle_says_what_it_is_to_be_run_with(bundle):
    rewrite(bundle, conditions={"controller": "vices", "gains": "low", "as_paper": True})
    assert Bundle.load(bundle).conditions == Conditions("vices", "low", True)


def test_a_network_of_six_outputs_is_exported_with_eighteen():
    _, layers, scaling = networks()
    first = torch.nn.Sequential(*layers[:-1], torch.nn.Linear(16, 6))
    action = DeployedPolicy(first, scaling)(torch.ones(2, 6), torch.ones(2, 128))
    assert action.shape == (2, 18)
    assert torch.equal(action[:, 6:], torch.zeros(2, 12))
    assert torch.equal(action[:, :6], DeployedPolicy(first, scaling).layers(scaled_ones(scaling)).clamp(-1, 1))


def scaled_ones(scaling):
    return torch.from_numpy(scaling({"pose": np.ones((2, 6))}, np.ones((2, 128), np.float32)))


def test_not_a_model(bundle):
    (bundle / "policy.onnx").write_bytes(b"garbage" * 10)
    reseal(bundle, "policy.onnx")
    assert refusal(bundle).startswith(f"{bundle}/policy.onnx is not a model ONNX Runtime takes (")


def test_wrong_ports(bundle):
    shutil.copy(bundle / "encoder.onnx", bundle / "policy.onnx")
    reseal(bundle, "policy.onnx")
    assert refusal(bundle) == (
        f"{bundle}/policy.onnx: input state is absent, not tensor(float) of shape (N, 6); export the bundle anew"
    )


def test_operators_of_a_foreign_domain_are_refused(bundle):
    model = onnx.load(bundle / "policy.onnx")
    model.graph.node[0].domain = "com.evil"
    model.opset_import.append(onnx.helper.make_opsetid("com.evil", 1))
    (bundle / "policy.onnx").write_bytes(model.SerializeToString())
    reseal(bundle, "policy.onnx")
    assert refusal(bundle).startswith(f"{bundle}/policy.onnx is not a model ONNX Runtime takes (")


def test_weights_in_another_file_are_refused(bundle):
    model = onnx.load(bundle / "policy.onnx")
    onnx.save_model(model, bundle / "policy.onnx", save_as_external_data=True, location="weights.bin", size_threshold=0)
    reseal(bundle, "policy.onnx")
    assert refusal(bundle) == (f"{bundle}/policy.onnx keeps weights in another file; export it with the weights inside")


def crafted(folder, change):
    """Change the model of a policy, seal it with the right digest, and give what is said of it."""
    model = onnx.load(folder / "policy.onnx")
    change(model)
    (folder / "policy.onnx").write_bytes(model.SerializeToString())
    reseal(folder, "policy.onnx")
    return refusal(folder).removeprefix(f"{folder}/policy.onnx ")


def grow(kind, times=1, **attributes):
    """Put operators between the policy's first value and its second."""

    def change(model):
        first = model.graph.node[0]
        value, nodes = "grown", []
        first.output[0] = value
        for k in range(times):
            after = "cat" if k == times - 1 else f"grown{k}"
            nodes.append(onnx.helper.make_node(kind, [value, value], [after], **attributes))
            value = after
        rest = list(model.graph.node)
        del model.graph.node[:]
        model.graph.node.extend([rest[0], *nodes, *rest[1:]])

    return change


def add_node(kind, domain="", **attributes):
    def change(model):
        model.graph.node.append(onnx.helper.make_node(kind, ["state"], ["more"], domain=domain, **attributes))

    return change


def test_a_loop_of_2_to_the_62_is_refused_before_it_runs(bundle):
    body = onnx.helper.make_graph([], "body", [], [])
    told = crafted(bundle, add_node("Loop", body=body))
    assert told.startswith("is not a model ONNX Runtime takes (operator 'Loop' is not one of Abs, Elu, Erf, ")


@pytest.mark.parametrize("kind", ["If", "Scan", "ConstantOfShape", "Tile", "Expand", "Resize", "Range", "Einsum"])
def test_operators_whose_cost_cannot_be_told_are_refused(bundle, kind):
    assert crafted(bundle, add_node(kind)).startswith(f"is not a model ONNX Runtime takes (operator '{kind}' is not")


@pytest.mark.parametrize("domain", ["com.microsoft", "ai.onnx.ml", "ai.onnx.training", "ai.onnx"])
def test_operators_of_the_runtime_and_of_machine_learning_are_refused(bundle, domain):
    assert f"(operator '{domain}.Relu' is not one of " in crafted(bundle, add_node("Relu", domain))

    def declare(model):
        model.opset_import.append(onnx.helper.make_opsetid(domain, 1))

    assert "(it needs operators of [('', 18), (" in crafted(bundle, declare)


def test_functions_that_call_each_other_2_to_the_33_times_are_refused(bundle):
    def change(model):
        node = onnx.helper.make_node("Relu", ["x"], ["y"])
        opsets = [onnx.helper.make_opsetid("", 18)]
        model.functions.append(onnx.helper.make_function("", "Relu2", ["x"], ["y"], [node], opsets))

    told = crafted(bundle, change)
    assert told == "holds more than a graph of operators (functions, subgraphs or notes); export it anew"


def test_values_that_double_from_operator_to_operator_are_refused(bundle):
    told = crafted(bundle, grow("Concat", 40, axis=1))
    assert told == "computes more than 16000000 numbers or 1000000000 products for one observation; export it anew"


def test_weights_that_are_used_over_and_over_are_refused(bundle):
    """ONNX Runtime arranges them anew for each operator when it starts."""

    def change(model):
        model.graph.initializer.append(onnx.numpy_helper.from_array(np.eye(134, 1000, dtype=np.float32), "wide"))
        model.graph.initializer.append(onnx.numpy_helper.from_array(np.eye(1000, 1000, dtype=np.float32), "square"))
        nodes = [onnx.helper.make_node("MatMul", ["cat", "wide"], ["m0"])]
        nodes += [onnx.helper.make_node("MatMul", [f"m{k}", "square"], [f"m{k + 1}"]) for k in range(40)]
        model.graph.node.extend(nodes)

    assert crafted(bundle, change).startswith("computes more than 16000000 numbers or ")


def test_rows_that_meet_other_rows_are_refused(bundle):
    """N by N numbers are no longer bounded by the rows asked for, and an action must not depend on its neighbours."""
    for kind in ("MatMul", "Gemm"):
        assert (
            crafted(bundle, grow(kind)) == f"has an operator {kind} of a kind that nothing here exports; export it anew"
        )
    told = crafted(bundle, grow("Concat", axis=0))
    assert told == "has an operator Concat of a kind that nothing here exports; export it anew"


def test_too_many_operators_are_refused(bundle):
    assert crafted(bundle, grow("Add", 300)) == "has 308 operators, at most 256 are allowed; export it anew"


def test_a_convolution_that_pads_its_picture_to_2_gigabytes_is_refused(bundle):
    model = onnx.load(bundle / "encoder.onnx")
    conv = next(node for node in model.graph.node if node.op_type == "Conv")
    pads = next(attribute for attribute in conv.attribute if attribute.name == "pads")
    pads.ints[:] = [2**20] * 4
    (bundle / "encoder.onnx").write_bytes(model.SerializeToString())
    reseal(bundle, "encoder.onnx")
    assert refusal(bundle).endswith("has an operator Conv of a kind that nothing here exports; export it anew")


def test_weights_of_2_gigabytes_of_which_the_file_holds_none_are_refused(bundle):
    def change(model):
        model.graph.initializer[0].dims[:] = [2**20, 2**9]
        model.graph.initializer[0].ClearField("raw_data")

    assert crafted(bundle, change).startswith("has weights 'layers.0.weight' of shape (1048576, 512) without as many")


def test_nan_weights_are_refused(bundle):
    def change(model):
        bias = model.graph.initializer[1]
        bias.raw_data = np.full(16, np.nan, np.float32).tobytes()

    assert crafted(bundle, change) == "has weights 'layers.0.bias' that are not finite; export it anew"


def test_weights_given_out_as_an_action_are_refused(bundle):
    def change(model):
        del model.graph.node[:]
        model.graph.initializer.append(onnx.numpy_helper.from_array(np.zeros(18, np.float32), "action"))

    assert (
        crafted(bundle, change) == "has an output 'action' of shape [None, 18] that it does not compute; export it anew"
    )


def test_a_value_used_before_it_is_computed_is_refused(bundle):
    def turn(model):
        nodes = list(model.graph.node)[::-1]
        del model.graph.node[:]
        model.graph.node.extend(nodes)

    assert "before it is computed" in crafted(bundle, turn)


@pytest.mark.parametrize("kind", RULES)
def test_operators_without_outputs_are_refused_without_a_traceback(bundle, kind):
    """A Split was divided by their number."""

    def change(model):
        model.graph.node.append(onnx.helper.make_node(kind, ["state"], [], axis=1))

    assert crafted(bundle, change) == f"has an operator {kind} without outputs; export it anew"


@pytest.mark.parametrize("kind", RULES)
def test_operators_without_inputs_are_refused_without_a_traceback(bundle, kind):
    def change(model):
        model.graph.node.append(onnx.helper.make_node(kind, [], ["more"], axis=1))

    assert crafted(bundle, change) == f"has an operator {kind} of a kind that nothing here exports; export it anew"


@pytest.mark.parametrize("error", [ZeroDivisionError, OverflowError, FloatingPointError, IndexError, KeyError])
def test_no_arithmetic_of_a_rule_ends_in_a_traceback(bundle, monkeypatch, error):
    def rule(call):
        raise error

    monkeypatch.setitem(RULES, "Identity", rule)
    told = crafted(bundle, add_node("Identity"))
    assert told == "has an operator Identity of a kind that nothing here exports; export it anew"


def test_a_model_of_the_runtimes_own_format_is_refused(bundle):
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = str(bundle / "policy.ort")
    options.log_severity_level = 4
    options.add_session_config_entry("session.save_model_format", "ORT")
    onnxruntime.InferenceSession(bundle / "policy.onnx", options, providers=["CPUExecutionProvider"])
    (bundle / "policy.ort").rename(bundle / "policy.onnx")
    reseal(bundle, "policy.onnx")
    assert refusal(bundle).startswith(f"{bundle}/policy.onnx is not a model ONNX Runtime takes (it cannot be read as")


def test_what_onnx_runtime_gets_is_what_was_read(bundle):
    """Notes, shape hints and the like are not handed on."""
    data = (bundle / "policy.onnx").read_bytes()
    model = read_graph(data, "policy").model
    names = {field.name for field, _ in onnx.load_from_string(model).graph.ListFields()}
    assert names == {"node", "name", "initializer", "doc_string", "input", "output"}
    onnx.checker.check_model(onnx.load_from_string(model))
    assert read_graph(model, "policy").model == model


@pytest.mark.parametrize("name", ["bundle.json", "policy.onnx"])
def test_symbolic_links_out_of_the_folder_are_refused(bundle, tmp_path, name):
    outside = tmp_path / "outside"
    (bundle / name).rename(outside)
    (bundle / name).symlink_to(outside)
    assert refusal(bundle) == f"{bundle}/{name} is a link to another folder; copy the file itself"


def test_a_link_within_the_folder_and_one_to_the_folder_are_followed(bundle, tmp_path):
    (bundle / "policy.onnx").rename(bundle / "policy-1.onnx")
    (bundle / "policy.onnx").symlink_to("policy-1.onnx")
    (tmp_path / "latest").symlink_to(bundle)
    assert Bundle.load(tmp_path / "latest").rate_hz == 60.0


def test_a_pipe_a_folder_or_a_device_in_place_of_a_file_is_refused_at_once(bundle):
    path = bundle / "policy.onnx"
    path.unlink()
    os.mkfifo(path)
    assert refusal(bundle) == f"{path} is not a file; copy or export the bundle anew"
    path.unlink()
    path.mkdir()
    assert refusal(bundle) == f"{path} is not a file; copy or export the bundle anew"
    path.rmdir()
    path.symlink_to("/dev/zero")
    assert refusal(bundle) == f"{path} is a link to another folder; copy the file itself"
    path.unlink()
    path.symlink_to(path)
    assert refusal(bundle).startswith(f"{path} cannot be read: ")


def test_an_unreadable_file_is_told_in_one_line(bundle, monkeypatch):
    monkeypatch.setattr(os, "open", lambda *_: (_ for _ in ()).throw(PermissionError(13, "Permission denied")))
    assert refusal(bundle) == f"{bundle}/bundle.json cannot be read: Permission denied; check who may read it"


WILD = ("9" * 900_000, [0] * 100_000, {"x" * 100_000: 1}, 10**4000, [[["x"] * 9] * 9] * 9)


@pytest.mark.parametrize("value", WILD, ids=["text", "list", "object", "number", "nested"])
def test_a_field_of_900_000_digits_is_shown_short(bundle, value):
    whole = json.loads((bundle / "bundle.json").read_text())
    for field in ("format", "representation", "observes", "view_size", "window_m", "dither"):
        rewrite(bundle, **{**whole, field: value})
        assert len(refusal(bundle).replace(str(bundle), "")) < 250


def test_a_number_of_900_000_digits_is_no_json(bundle):
    text = (bundle / "bundle.json").read_text().replace("0.64", "9" * 900_000)
    (bundle / "bundle.json").write_text(text)
    assert refusal(bundle) == f"{bundle}/bundle.json is not JSON; the bundle is damaged, copy or export it anew"


def test_a_name_that_stands_twice_in_the_manifest_is_refused(bundle):
    text = (bundle / "bundle.json").read_text()
    (bundle / "bundle.json").write_text(text.replace("{", '{"format": 5,', 1))
    assert refusal(bundle) == (
        f"{bundle}/bundle.json says 'format' twice; the bundle is damaged, copy or export it anew"
    )


def test_numbers_of_log_polar_features_that_cannot_be_are_refused(tmp_path):
    folder = log_polar_bundle(tmp_path / "bundle", ["pose"])
    rewrite(folder, latent_size=5)
    assert refusal(folder).endswith(f"latent_size = 5 is outside [{FEATURES}, {FEATURES}]; export the bundle anew")


def test_what_the_exporter_makes_of_usual_networks_is_allowed():
    _, _, scaling = networks()
    nn = torch.nn
    usual = nn.LayerNorm(8), nn.ReLU(), nn.ELU(), nn.SiLU(), nn.GELU(), nn.Softplus(), nn.LeakyReLU(), nn.Sigmoid()
    layers = nn.Sequential(nn.Linear(134, 8), *usual, nn.Linear(8, 18), nn.Tanh())
    examples = [torch.zeros(2, 6), torch.zeros(2, 128)]
    module = DeployedPolicy(layers, scaling)
    compare(module, to_onnx(module, examples, ["state", "latent"], "action"), "policy", examples, ["state", "latent"])


def test_damage_of_every_kind_is_refused_or_harmless():
    """A slice of `benchmarks/fuzz.py`, which has the long campaign."""
    results = list(fuzz.bundles(1, range(60)))
    assert [result for result in results if result[2] not in ("refused", "harmless")] == []
    assert sum(outcome == "refused" for *_, outcome in results) > 20


def test_what_somebody_put_beside_a_bundle_stays_when_it_is_written_anew(bundle):
    _, layers, scaling = networks()
    (bundle / "notes.txt").write_text("years of work")
    export_bundle(bundle, (bundle / "encoder.onnx").read_bytes(), layers, scaling, DESCRIPTION, force=True)
    assert (bundle / "notes.txt").read_text() == "years of work"


def test_exported_models_carry_no_paths(exported):
    for name in ("encoder.onnx", "policy.onnx"):
        data = (exported / name).read_bytes()
        assert b".py" not in data
        assert b"/" + b"tmp" not in data


def test_export_does_not_overwrite_unasked_and_leaves_nothing_behind(bundle, tmp_path):
    _, layers, scaling = networks()
    encoder = (bundle / "encoder.onnx").read_bytes()
    before = (bundle / "bundle.json").read_bytes()
    with pytest.raises(OutputError) as error:
        export_bundle(bundle, encoder, layers, scaling, DESCRIPTION)
    assert str(error.value) == f"{bundle} exists; pass force=True to replace it, or give another folder"
    with pytest.raises(OutputError, match="nothing was changed"):
        export_bundle(bundle, b"no model", layers, scaling, DESCRIPTION, force=True)
    assert (bundle / "bundle.json").read_bytes() == before
    export_bundle(bundle, encoder, layers, scaling, {**DESCRIPTION, "rate_hz": 30.0}, force=True)
    assert Bundle.load(bundle).rate_hz == 30.0
    other = tmp_path / "precious"
    other.mkdir()
    (other / "thesis.tex").write_text("years of work")
    with pytest.raises(OutputError) as error:
        export_bundle(other, encoder, layers, scaling, DESCRIPTION, force=True)
    assert str(error.value) == f"{other} is no bundle and will not be replaced; give another folder"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bundle", "precious"]


def test_another_processors_rounding_kept_a_run_from_leaving_its_bundle(bundle):
    """A policy 1.7e-5 apart between torch and ONNX Runtime was not written: hours of training without a result."""
    _, layers, scaling = networks()
    module = DeployedPolicy(layers, scaling)
    examples = [torch.zeros(2, 6), torch.zeros(2, 128)]
    data = to_onnx(module, examples, ["state", "latent"], "action")
    with torch.no_grad():
        layers[-1].bias += 2e-5
    compare(module, data, "policy", examples, ["state", "latent"])


def test_a_model_that_computes_something_else_is_not_written(bundle):
    _, layers, scaling = networks()
    module = DeployedPolicy(layers, scaling)
    examples = [torch.zeros(2, 6), torch.zeros(2, 128)]
    data = to_onnx(module, examples, ["state", "latent"], "action")
    with torch.no_grad():
        layers[-1].bias += 0.1
    with pytest.raises(
        ContactSafeError, match=r"^policy differs from the trained network by .*, allowed 0.0001; not written$"
    ):
        compare(module, data, "policy", examples, ["state", "latent"])
