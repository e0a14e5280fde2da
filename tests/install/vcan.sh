# Executed in the virtual machine after the guide's blocks: the simulated machine, its operator and a planner join
# the bus through the kernel's SocketCAN, can-utils listen and disturb, then everything that can end a service does.
# No `set -e`: what each step came to is judged outside.
exec 2>> vcan.err
python=/opt/slewright-hil/bin/python
uname --kernel-version > kernel
control() {
    grep --files-with-matches --null-data --line-regexp 'runtime[.]control_process' /proc/[0-9]*/cmdline | cut -d/ -f3
}
state() { systemctl show slewright.service --property ActiveState,SubState,Result,NRestarts,StatusText; }

# -- a scenario over vcan --------------------------------------------------------------------------------
systemctl stop slewright.service
candump -L can0 > candump.log &
listener=$!
mkfifo /run/told  # not among the results: a pipe cannot come back
cd /srv
$python -m deployment.hil.machine_node '{"scenario": "four_targets_empty", "seed": 1, "ticks": 1000, "planner": true, "interface": "socketcan", "channel": "can0", "record": "/srv/results/machine.parquet"}' < /run/told > results/machine.out &
machine=$!
cd results
exec 3> /run/told
for _ in $(seq 120); do grep -q ready machine.out && break; sleep 1; done
systemctl start slewright.service
state > started
sleep 3
echo start >&3
sleep 8
# A frame nobody knows, and one that says it is the slew's position but has no right checksum.
cansend can0 18FFEE99#DEADBEEF
cansend can0 "$($python -c 'from runtime.can.table import TIMED_BY; from specs.signals import definition; print(f"{definition().bus.messages[TIMED_BY].frame_id:08X}")')#0000000000000000"
sleep 4
state > driving
chrt --pid "$(control)" > priority
taskset --cpu-list --pid "$(control)" > core
grep VmLck "/proc/$(control)/status" > locked
stat --format %U "/proc/$(control)" > user
wait $machine
echo $? > machine.rc
exec 3>&-
kill $listener
$python - <<'END' > drive.json
import json
from records.metrics import compute
from records.record import read
record = read("machine.parquet")
found = {"modes": sorted(set(record.column("control_mode")[50:].tolist())), "rows": len(record),
         "faults": sorted(set(record.column("fault_code").tolist())), "late": record.meta.get("late_ticks"),
         "metrics": compute(record).as_dict()}
print(json.dumps(found))
END

# -- it ends as it should --------------------------------------------------------------------------------
systemctl stop slewright.service
state > stopped
digest=$(python3 -c 'import json; print(json.load(open("/srv/first.json"))["digest"])')
/opt/slewright/bin/slewright replay /var/lib/slewright/recording --bundle "/var/lib/slewright/store/bundles/$digest/bundle" > replay.out 2>&1
echo $? > replay.rc

# -- a control process that hangs is ended by the watchdog and stays away --------------------------------
systemctl start slewright.service
sleep 3
kill -STOP "$(control)"
sleep 20
state > hung
systemctl reset-failed slewright.service

# -- a control process that is killed, too ---------------------------------------------------------------
systemctl start slewright.service
sleep 3
kill -KILL "$(control)"
sleep 5
state > killed
systemctl reset-failed slewright.service

# -- the adapter is pulled out ---------------------------------------------------------------------------
systemctl start slewright.service
sleep 3
ip link delete can0
sleep 5
state > pulled
journalctl --no-pager > journal
