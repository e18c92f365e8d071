from .distribution import Distribution as Distribution
from .executors import DaskExecutor as DaskExecutor
from .finished import pack as pack
from .folder import BatchFolder as BatchFolder, keep_plan as keep_plan, stored as stored
from .keys import parse_key as parse_key
from .plan import Plan as Plan, read_plan as read_plan
from .report import load_batch as load_batch, parquet as parquet, status_text as status_text
from .run import (
    Progress as Progress,
    RunOptions as RunOptions,
    in_shard as in_shard,
    run_batch as run_batch,
    trial_text as trial_text,
)
from .variation import Variation as Variation, vary_model as vary_model, vary_table as vary_table
from .worker import Outcome as Outcome, make_scene as make_scene
