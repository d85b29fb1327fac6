//! A plan on a Slurm cluster of two nodes on this machine, with preemption, a killed process and a lost node.

use super::shot::{Shot, assert_same, wait_until, workplace};
use crate::common::{entries, here};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

/// The programs of Debian's packages.
const PROGRAMS: [&str; 5] = ["munged", "slurmctld", "slurmd", "sbatch", "unshare"];

/// Names of the nodes.
const NODES: [&str; 2] = ["n1", "n2"];

/// Slurm on this machine, running until it is dropped.
struct Cluster {
    folder: TempDir,
    /// Authentication and controller.
    services: Vec<Child>,
    /// The nodes. The processes of a node have a name space of their own, so that they die together.
    nodes: Vec<Child>,
}

impl Cluster {
    /// Installs Slurm if necessary and starts it. If that fails, prints why the test is skipped.
    fn start() -> Option<Cluster> {
        if let Err(why) = install() {
            println!("skipped: {why}");
            return None;
        }
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("spool")).unwrap();
        std::fs::write(folder.path().join("slurm.conf"), configuration(folder.path())).unwrap();
        std::fs::write(folder.path().join("key"), [7; 1024]).unwrap();
        let mut cluster = Cluster { folder, services: Vec::new(), nodes: Vec::new() };
        let at = |name: &str| format!("{}/{name}", cluster.folder.path().display());
        let munge = ["key-file", "socket", "pid-file", "log-file", "seed-file"]
            .map(|option| format!("--{option}={}", at(option.trim_end_matches("-file"))));
        // munge refuses the permissions of temporary folders otherwise.
        let munge = cluster.spawn("munged", ["--foreground".into(), "--force".into()].iter().chain(&munge));
        cluster.services.push(munge);
        wait_until("munge", || Path::new(&at("socket")).exists());
        let controller = cluster.spawn("slurmctld", &["-D".into(), "-c".into()]);
        cluster.services.push(controller);
        for name in NODES {
            let node = ["--pid", "--fork", "--mount-proc", "--kill-child", "slurmd", "-D", "-N", name];
            let node = cluster.spawn("unshare", &node.map(String::from));
            cluster.nodes.push(node);
        }
        wait_until("node", || {
            cluster.ask("sinfo", &["-hN", "-p", "low", "-o", "%t"]).matches("idle").count() == 2
        });
        Some(cluster)
    }

    fn spawn<'a>(&self, program: &str, arguments: impl IntoIterator<Item = &'a String>) -> Child {
        self.command(program).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.env("SLURM_CONF", self.folder.path().join("slurm.conf")).current_dir(self.folder.path());
        command
    }

    /// The standard output of a command.
    fn ask(&self, program: &str, arguments: &[&str]) -> String {
        String::from_utf8(self.command(program).args(arguments).output().unwrap().stdout).unwrap()
    }

    /// One line for each job of this name.
    fn job(&self, name: &str) -> String {
        let all = self.ask("scontrol", &["show", "job", "-o"]);
        all.lines().filter(|line| line.contains(&format!("JobName={name} "))).collect::<Vec<_>>().join("\n")
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for child in self.nodes.iter_mut().chain(&mut self.services) {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// # Errors
/// The reason why Slurm cannot be installed.
fn install() -> Result<(), &'static str> {
    let succeeds = |program: &str, arguments: &[&str]| {
        Command::new(program).args(arguments).output().is_ok_and(|output| output.status.success())
    };
    let is_there = || PROGRAMS.iter().all(|name| succeeds("sh", &["-c", &format!("command -v {name}")]));
    if Command::new("id").arg("-u").output().map_or(true, |output| output.stdout != b"0\n") {
        return Err("only root may start a Slurm of two nodes");
    }
    if !is_there() {
        println!("installing Slurm");
        let update = succeeds("apt-get", &["update"]);
        let packages = ["munge", "slurmctld", "slurmd", "slurm-client"];
        let install = [&["install", "-y", "--no-install-recommends"], &packages[..]].concat();
        if !(update && succeeds("apt-get", &install) && is_there()) {
            return Err(
                "there is no Slurm, and apt-get cannot install munge, slurmctld, slurmd and slurm-client",
            );
        }
    }
    if !succeeds("unshare", &["--pid", "--fork", "--mount-proc", "true"]) {
        return Err("processes may get no name space of their own here");
    }
    Ok(())
}

/// A cluster that requeues as in docs/farm.md, with short times for the tests: a node that is silent for 10 s
/// counts as dead, and a requeued task waits 5 s. Jobs in the partition `high` preempt those in `low`.
fn configuration(folder: &Path) -> String {
    let host = String::from_utf8(here(Path::new("/proc/sys/kernel/hostname"))).unwrap();
    let (folder, host) = (folder.display(), host.trim());
    let listeners = [(); 3].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
    let [controller, n1, n2] = listeners.map(|listener| listener.local_addr().unwrap().port());
    format!(
        "ClusterName=test\n\
         SlurmctldHost={host}(127.0.0.1)\n\
         SlurmctldPort={controller}\n\
         NodeName=n1,n2 NodeHostname={host} NodeAddr=127.0.0.1 Port={n1},{n2} CPUs=1\n\
         PartitionName=low Nodes=n1,n2 Default=YES PriorityTier=1 GraceTime=60\n\
         PartitionName=high Nodes=n1,n2 PriorityTier=2 PreemptMode=OFF\n\
         PreemptType=preempt/partition_prio\n\
         PreemptMode=REQUEUE\n\
         SlurmctldParameters=preempt_send_user_signal\n\
         RequeueExit=75,85\n\
         AuthType=auth/munge\n\
         AuthInfo=socket={folder}/socket,cred_expire=5\n\
         SlurmUser=root\n\
         SlurmdUser=root\n\
         StateSaveLocation={folder}\n\
         SlurmdSpoolDir={folder}/spool/%n\n\
         SlurmctldPidFile={folder}/controller.pid\n\
         SlurmdPidFile={folder}/%n.pid\n\
         SlurmctldLogFile={folder}/controller.log\n\
         SlurmdLogFile={folder}/%n.log\n\
         SlurmdTimeout=10\n\
         SchedulerType=sched/builtin\n\
         SchedulerParameters=batch_sched_delay=0,sched_interval=1\n\
         SelectType=select/cons_tres\n\
         ProctrackType=proctrack/linuxproc\n\
         TaskPlugin=task/none\n\
         JobAcctGatherType=jobacct_gather/none\n\
         MpiDefault=none\n\
         MailProg=/bin/true\n"
    )
}

/// The process of hairbake whose command line has all these words.
fn process(words: &[&str]) -> Option<u32> {
    let program = assert_cmd::cargo::cargo_bin!("hairbake");
    let is_it = |id: &u32| {
        let line = std::fs::read(format!("/proc/{id}/cmdline")).unwrap_or_default();
        let line: Vec<&[u8]> = line.split(|byte| *byte == 0).collect();
        line[0] == program.as_os_str().as_encoded_bytes()
            && words.iter().all(|word| line.contains(&word.as_bytes()))
    };
    entries(Path::new("/proc")).iter().filter_map(|name| name.parse().ok()).find(is_it)
}

#[test]
fn slurm_survives_preemption_a_kill_and_a_lost_node() {
    let Some(mut cluster) = Cluster::start() else { return };
    let shot = Shot::get();
    let folder = workplace();
    // Slow enough to be interrupted.
    let slow = ["--substeps", "400"];
    let [once, out] = ["once", "out"].map(|name| folder.path().join(name));
    let mut at_once = shot.bake(&once, &slow).spawn().unwrap();
    let options = ["--format", "slurm", "--segment", "6", "--chunk", "4", "--no-validate"];
    let script = folder.path().join("job.sh");
    std::fs::write(&script, shot.plan(&out, &[&options[..], &slow].concat())).unwrap();
    let log = format!("--output={}/%x.log", folder.path().display());
    let submitted = cluster.command("bash").arg(script).arg(log).output().unwrap();
    assert!(submitted.status.success(), "{}", String::from_utf8_lossy(&submitted.stderr));
    let said = |name: &str| {
        std::fs::read_to_string(folder.path().join(format!("shake: {name}.log"))).unwrap_or_default()
    };
    let simulated = |frame: i32| out.join(format!(".hairbake/states/{frame}")).exists();

    wait_until("first segment", || out.join(".hairbake/job.json").exists());
    let preempting = ["--partition=high", "--nodes=2", "--exclusive", "--output=/dev/null", "--wrap=true"];
    cluster.ask("sbatch", &preempting);
    wait_until("preemption", || said("simulate 1").contains("stopped as requested"));

    wait_until("second segment", || simulated(1006));
    let killed = process(&["simulate", &out.display().to_string()]).unwrap();
    assert!(Command::new("kill").args(["-KILL", &killed.to_string()]).status().unwrap().success());
    wait_until("second attempt", || said("simulate 2").contains("killed in attempt 1") && simulated(1008));
    let on = cluster.ask("squeue", &["-h", "-t", "R", "-n", "shake: simulate 2", "-o", "%N"]);
    let node = NODES.iter().position(|name| on.trim() == *name).unwrap();
    cluster.nodes[node].kill().unwrap();

    wait_until("end of all jobs", || cluster.ask("squeue", &["-h"]).is_empty());
    for name in ["simulate 1", "simulate 2", "simulate 3", "assemble"] {
        let job = cluster.job(&format!("shake: {name}"));
        assert!(job.contains("JobState=COMPLETED"), "{job}\n{}", said(name));
        // One was preempted, one ran on the lost node.
        let restarted = ["simulate 1", "simulate 2"].contains(&name);
        assert!(!restarted || !job.contains("Restarts=0 "), "{job}");
    }
    assert_eq!(cluster.job("shake: interpolate 2").lines().count(), 2, "not an array of two");
    assert!(at_once.wait().unwrap().success());
    std::fs::remove_file(out.join("sheet.png")).unwrap();
    assert_same(&once, &out);
}
