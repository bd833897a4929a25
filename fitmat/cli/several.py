"""Commands over many files: laboratories of one sample, and batches; parse, one library call, print.

Those that begin with measurements of one sample are in `commands`.
"""

from pathlib import Path
from typing import Any

import typer

from fitmat.cli import examples, process
from fitmat.cli.entry import app
from fitmat.cli.flags.batch import (
    BatchOutFlag,
    DeviceFlag,
    JobsFlag,
    LightsFlag,
    McmcFlag,
    PoolFlag,
    PrecisionFlag,
    ProcessesFlag,
    ReplaceBatchFlag,
    RunsFlag,
    SchedulerFlag,
    SmoothFlag,
    SourcesFlag,
)
from fitmat.cli.flags.files import JsonFlag
from fitmat.cli.flags.fitting import (
    MODELS,
    DispersionFlag,
    FilmFlag,
    FixFlag,
    IorFlag,
    LossFlag,
    MaskingFlag,
    ModelsFlag,
    PriorFlag,
    SeedFlag,
    TiltFlag,
)
from fitmat.cli.flags.given import Command, typed
from fitmat.cli.flags.groups import takes
from fitmat.cli.flags.instrument import instrument
from fitmat.cli.flags.labs import LaboratoriesFlag, SurfaceFlag
from fitmat.cli.flags.reading import reading


@app.command(
    cls=Command,
    epilog=examples.LABS,
)
@takes(reading, instrument)
def labs(
    reading: dict[str, Any],
    instrument: Any,
    laboratories: LaboratoriesFlag,
    model: SurfaceFlag = "lambert+ggx",
    json_: JsonFlag = False,
    fix: FixFlag = None,
) -> None:
    """Say whether laboratories that measured one sample agree, what follows from all, and whose calibration is off."""
    from fitmat.cli import session

    with session.computing() as watch:
        from fitmat.cli import labs
        from fitmat.models.parameters import assignments

        read, held = reading | {"instrument": instrument}, assignments(fix or [], "--fix")
        found = labs.compared(laboratories, read, model, held, watch)
    if json_:
        process.say(labs.as_json(found))
    else:
        labs.show(found)


@app.command(
    cls=Command,
    epilog=examples.BATCH,
)
@takes(reading, instrument)
def batch(
    context: typer.Context,
    reading: dict[str, Any],
    instrument: Any,
    files: SourcesFlag = None,
    out: BatchOutFlag = Path("fitmat-batch"),
    jobs: JobsFlag = None,
    lights: LightsFlag = None,
    models: ModelsFlag = MODELS,
    processes: ProcessesFlag = None,
    scheduler: SchedulerFlag = None,
    device: DeviceFlag = "cpu",
    precision: PrecisionFlag = "double",
    pool: PoolFlag = None,
    runs: RunsFlag = False,
    smooth: SmoothFlag = None,
    mcmc: McmcFlag = False,
    seed: SeedFlag = 0,
    fix: FixFlag = None,
    masking: MaskingFlag = None,
    loss: LossFlag = "default",
    prior: PriorFlag = None,
    ior: IorFlag = None,
    tilt: TiltFlag = False,
    dispersion: DispersionFlag = None,
    film: FilmFlag = None,
    force: ReplaceBatchFlag = False,
) -> None:
    """Fit every file of a folder or a list, or every point of a texture, and write one table of all."""
    process.set_up()
    from fitmat.cli import batch, fit

    told = {"models": models, "loss": loss, "masking": masking, "ior": ior, "tilt": tilt, "seed": seed}
    told |= {"dispersion": dispersion, "film": film, "sampling": mcmc} | fit.known(fix or [], prior or [])
    read = reading | {"instrument": instrument}
    if lights is not None or batch.is_texture(files or []):
        doing = {"threads": processes, "device": device, "precision": precision, "smooth": smooth, "force": force}
        return batch.texture(batch.alone(lights, files or []), out, typed(context), told, doing)
    doing = {"processes": processes, "scheduler": scheduler, "device": device, "pool": pool}
    doing |= {"precision": precision, "runs": runs, "smooth": smooth, "force": force}
    found = batch.run(files or [], out, jobs, read, told, doing)
    batch.show(found)
    if found.counts["refused"]:
        raise typer.Exit(process.NOT_CONVERGED)
