#!/bin/sh
# A Slurm cluster of this one machine, for tests. Needs root and Debian's packages:
#   apt-get install slurm-wlm munge
#   tests/cluster/slurm.sh start FOLDER      keys, state and logs lie in FOLDER
#   tests/cluster/slurm.sh stop FOLDER
# The commands inside of jobs find a cluster by /etc/slurm/slurm.conf alone, so that it is laid there
# for as long as this cluster runs; where one lies already, this script touches nothing and ends.
set -eu
conf=/etc/slurm/slurm.conf
# Every user must be able to reach the socket, through folders that nobody else can write to.
munge=/run/cellwright-slurm
fail() { printf 'slurm.sh: %s\n' "$*" >&2; exit 1; }

[ $# -eq 2 ] || fail "wanted: slurm.sh start|stop FOLDER"
mkdir -p "$2"
folder=$(CDPATH='' cd -- "$2" && pwd -P)
[ "$(id -u)" -eq 0 ] || fail "root is needed: jobs are started by a daemon that changes users"

start() {
    for program in munged slurmctld slurmd sinfo; do
        command -v $program >/dev/null || fail "$program is missing (apt-get install slurm-wlm munge)"
    done
    [ ! -e $conf ] || fail "$conf exists: another cluster's, which stays as it is"
    mkdir -p "$folder/state" "$folder/spool"
    mkdir -p -m 755 $munge
    (umask 077 && head -c 1024 /dev/urandom >$munge/key)
    name=$(hostname -s)
    memory=$(awk '/^MemTotal/ {print int($2 / 1024)}' /proc/meminfo)
    cat >$conf <<END
# Written by tests/cluster/slurm.sh
ClusterName=cellwright
SlurmctldHost=$name(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$munge/socket
CredType=cred/munge
SlurmctldPort=16817
SlurmdPort=16818
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/linux
AccountingStorageType=accounting_storage/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
ReturnToService=2
# squeue knows ended jobs for this long [s]; accounting, which would know them for ever, needs a database.
MinJobAge=3600
NodeName=$name NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$memory State=UNKNOWN
PartitionName=cells Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
    munged --key-file=$munge/key --socket=$munge/socket --pid-file=$munge/pid \
        --log-file=$munge/log --seed-file=$munge/seed
    slurmctld
    slurmd
    for _ in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15; do
        case $(sinfo --noheader --format %t 2>/dev/null) in idle | mix | alloc) return ;; esac
        sleep 1
    done
    fail "no node is ready; see $folder/slurmctld.log and $folder/slurmd.log"
}

stop() {
    grep -qs "^StateSaveLocation=$folder/state$" $conf || return 0
    # Each writes files (munged its seed) until it has ended.
    for pid in "$folder/slurmd.pid" "$folder/slurmctld.pid" $munge/pid; do
        [ -e "$pid" ] && process=$(cat "$pid") && kill "$process" 2>/dev/null || continue
        for _ in 1 2 3 4 5 6 7 8 9 10; do
            kill -0 "$process" 2>/dev/null || break
            sleep 1
        done
    done
    rm -rf $conf $munge
}

case $1 in
    start) trap '[ $? -eq 0 ] || stop' EXIT; start ;;
    stop) stop ;;
    *) fail "wanted: slurm.sh start|stop FOLDER" ;;
esac
