#!/usr/bin/env bash
# Simulations as jobs of a real SLURM, on one node that is this machine: munged, slurmctld and slurmd run for as long as the command.
# Needs root and Debian's slurm-wlm and munge. From the root of the repository:
#     tests/benchmarks/slurm_one_node.sh ./bayesindent build FILE.nml        with engine = 'dask', scheduler = 'slurm' in &execution
set -euo pipefail

folder=$(mktemp -d)
node=$(hostname -s)
chmod 755 "$folder"
mkdir -p "$folder/ctld" "$folder/d" "$folder/dask"
cat >"$folder/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$node(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
ReturnToService=2
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmdSpoolDir=$folder/d
StateSaveLocation=$folder/ctld
NodeName=$node NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=main Nodes=$node Default=YES MaxTime=INFINITE State=UP
CONF
cat >"$folder/dask/jobqueue.yaml" <<CONF
jobqueue:
  slurm:
    name: bayesindent
    cores: 1
    processes: 1
    memory: 1GB
    walltime: '01:00:00'
    queue: main
    interface: lo
    log-directory: $folder
    job-directives-skip: ['--mem']
CONF
export SLURM_CONF=$folder/slurm.conf DASK_CONFIG=$folder/dask

finish() {
  kill "$(cat "$folder/slurmd.pid")" "$(cat "$folder/slurmctld.pid")" 2>/dev/null || true
  wait
}
trap finish EXIT

if ! pgrep -x munged >/dev/null; then
  [ -s /etc/munge/munge.key ] || mungekey --create
  mkdir -p /run/munge
  chown munge: /run/munge
  runuser -u munge -- munged
fi
slurmctld -D >"$folder/slurmctld.log" 2>&1 &
slurmd -D >"$folder/slurmd.log" 2>&1 &
for _ in $(seq 60); do
  sinfo -h -o %T 2>/dev/null | grep -q idle && break
  sleep 1
done
sinfo
"$@"
squeue -t all -o '%i %j %T %M'
