"""Names of the stages that exist only if the parameters name a fleet.

They are not among ``run_record.STAGES``, on which the code hash of every other stage depends.
"""

from cylinder_friction.run_record import STAGES

FLEET_STAGES = ("fleet", "monitor")
"""``monitor`` may read what ``fleet`` wrote. Neither depends on another stage."""

EVERY_STAGE = (*STAGES, *FLEET_STAGES)
