"""`python -m calib` as a user types it: every mistake is one line and exit code 2, and nothing is written."""

from importlib.metadata import version
from pathlib import Path

import pytest

from calib.commands.fit import scale_of
from calib.errors import TableError
from calib.extract import executor
from calib.sim import Simulator
from calib.sim.mechanics import Tool, ToolPose
from calib.sim.of_sensor import camera_of
from calib.simulated_calibration import mm_per_px
from edge.calibration import Calibration
from edge.errors import ConfigError
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.rest.tip_match import match_tip
from edge.sensors import load_sensor
from hostlink.output_file import WriteError
from tests.support.commands import Done, run_calib


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ("dance", "No such command 'dance'; see python -m calib --help"),
        ("fit -o {out}/tip.json", "TABLE"),
        ("fit {data}/press.mcap -o {out}/tip.json", "press.mcap: a recording, but no capture"),
        ("fit {out}/absent.mcap -o {out}/tip.json", "absent.mcap: no such recording"),
        ("evaluate {out}/absent.json {data}/press.mcap", "absent.json: cannot be read"),
        ("fit {data}/press.mcap -o {out}/tip.json --mm-per-px nan", "'nan' is not a number; give"),
        ("capture --rig sim --protocol surface -o {out}/c.mcap --resume", "leave --resume out to begin one"),
        ("capture --rig gcode:/dev/no --protocol surface -o {out}/c.mcap", "stage /dev/no: No such file"),
        ("scale -o {out}", "exists; give the name of a new folder"),
        ("scale -o {out}/new --scale /dev/absent", "give the scale's port, e.g. /dev/ttyUSB0"),
        ("demo --data {data} --out {data}", "the recordings are there; give another folder"),
        ("fit {data}/press.mcap -o {out}/tip.json --hold-out nan", "'nan' is not a number; give"),
        # An output before the recording, which is no capture.
        ("fit {data}/press.mcap -o {data}/press.mcap", "press.mcap: the name must end in .json"),
        ("fit {data}/press.mcap -o {data}/hex127_flat.json", "hex127_flat.json: exists already"),
        ("fit {data}/press.mcap -o {data}/tip.json --prior {data}/tip.json", "tip.json: is an input of this"),
        ("demo --data {data} --out {data}/pictures", "exists already; give another name, or --overwrite"),
        ("demo --data {out} --out {out}/demo", "no press.mcap in it; give --data"),
        ("simulate digitac -o {out}/tip.json", "digitac cannot be simulated: its file has no pins.layout"),
        ("simulate thumb -o {out}/tip.json", "sensor 'thumb' is unknown; one of digitac, "),
        ("demo --data {out}/absent --out {out}/demo", "no such folder of recordings"),
        ("demo --data {data} --out {data}/press.mcap", "is no folder; give the name of one to --out"),
        *(
            (f"capture --rig {rig} --protocol surface -o {{out}}/c.mcap", "is unknown; one of sim, sim:")
            for rig in ("robot", "robot:1", "simulator", "gcode:")
        ),
        ("capture --rig sim:digitac --protocol surface -o {out}/c.mcap", "its file has no pins.layout"),
        ("capture --rig sim --protocol none.toml -o {out}/c.mcap", "none.toml"),
        ("capture --rig sim --protocol dance -o {out}/c.mcap", "displacement"),
        ("capture --rig sim --protocol surface -o {out}/c.avi", "c.avi: give a name that ends in .mcap"),
        ("capture --rig sim --protocol surface -o {out}/c.mcap --colour red", "--colour"),
        ("capture --rig sim:none.toml --protocol surface -o {out}/c.mcap", "none.toml"),
        ("report -o {out} --real {out}", "no targets.csv"),
    ],
)
def test_a_mistake_is_one_line(data_dir: Path, tmp_path: Path, arguments: str, expected: str) -> None:
    words = (word.format(data=data_dir, out=tmp_path) for word in arguments.split())
    assert expected in run_calib(*words).refusal
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("address", ["foo", "tcp://", "tcp://host", "bogus://host:1", "tcp://host:port"])
def test_an_invalid_cluster_address_is_refused_at_once(address: str) -> None:
    with pytest.raises(TableError, match="not an address; give one such as"), executor(address):
        pass


def test_version() -> None:
    assert run_calib("--version") == Done(0, f"python -m calib {version('voronoi-touch')}\n")


@pytest.mark.parametrize("option", ["--out", "--captures"])
def test_a_file_is_no_folder_for_a_report(tmp_path: Path, option: str) -> None:
    file = tmp_path / "text.png"
    file.write_text("mine")
    given = {"--out": tmp_path / "out"} | {option: file}
    done = run_calib("report", *(text for pair in given.items() for text in pair))
    assert done.refusal == f"error: {file}: is a file; give a folder"
    assert file.read_text() == "mine"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux alone has a device that is always full")
def test_a_disk_that_fills_during_the_pictures_leaves_none_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file's name and the reason, not those of stdout; and no half a picture."""
    from matplotlib.figure import Figure

    from calib.report import plots

    def full(self: Figure, path: Path, **_: object) -> None:
        with open("/dev/full", "wb", buffering=0) as file:
            Path(path).write_bytes(b"half")
            file.write(b"half")

    monkeypatch.setattr(Figure, "savefig", full)
    with pytest.raises(WriteError, match=r"trade\.png: cannot be written: No space left on device"):
        plots._save(Figure(), tmp_path / "trade.png")
    assert not list(tmp_path.iterdir())


def test_the_scale_of_a_fit_follows_from_the_pitch_of_the_sensor() -> None:
    simulator = Simulator(camera_of(load_sensor("tactip-127"), (320, 240)))
    rest = take_rest([simulator.frame().image])
    assert scale_of("tactip-127", rest) == pytest.approx(mm_per_px(simulator), rel=0.003)
    assert scale_of(None, rest) is None
    with pytest.raises(ConfigError, match="tactip-331: no scale follows from it, its file has no pitch_mm"):
        scale_of("tactip-331", rest)
    with pytest.raises(ConfigError, match=r"gelsight-mini: no scale .* the pins are not in its layout"):
        scale_of("gelsight-mini", rest)


@pytest.mark.usefixtures("quick_fits")
def test_a_simulated_sensor_is_calibrated_by_one_command(tmp_path: Path) -> None:
    path = tmp_path / "sim127.json"
    assert run_calib("simulate", "tactip-127", "-o", path, "--presses", "50", "-q").code == 0
    calibration = Calibration.load(path)
    assert calibration.content.sensor.serial == "simulated tactip-127"
    tip = Simulator(camera_of(load_sensor("tactip-127")), seed=99)
    pipeline = Pipeline(match_tip(calibration, take_rest([tip.frame().image]))[0], calibration)
    for depth_mm in (1.0, 2.5):
        pipeline.forget()
        pose = ToolPose(Tool("sphere", 3.0), depth_mm=depth_mm, x_mm=2.0)
        reading = pipeline.process(tip.frame((pose,))).reading
        assert reading.values["displacement_mm"] == pytest.approx(depth_mm, abs=0.15)
