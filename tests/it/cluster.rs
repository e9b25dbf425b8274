//! Snakemake on this machine and on a Slurm cluster of one node; also for the benches.

use crate::python::tool_path;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Where Slurm looks for its configuration.
const SLURM_CONF: &str = "/etc/slurm/slurm.conf";
const CGROUP_CONF: &str = "/etc/slurm/cgroup.conf";
/// What our configuration begins with: another one belongs to a real cluster and is left alone.
const OURS: &str = "# One node for the tests of hgm.\n";

/// Slurm's two daemons, ended with the test.
pub struct OneNodeSlurm {
    daemons: Vec<Child>,
}

impl OneNodeSlurm {
    /// Needs root and Debian's packages slurmctld, slurmd and slurm-client.
    pub fn start(folder: &Path) -> Self {
        let before = std::fs::read_to_string(SLURM_CONF).unwrap_or_else(|_| OURS.to_owned());
        assert!(before.starts_with(OURS), "{SLURM_CONF} is not from these tests: run them where no cluster is set up");
        for name in ["state", "spool"] {
            std::fs::create_dir_all(folder.join(name)).unwrap();
        }
        let node = printed("hostname", &[]);
        let folder = folder.display();
        let settings = format!(
            "{OURS}ClusterName=hgm\nSlurmctldHost={node}(127.0.0.1)\nSlurmctldPort=26817\nSlurmdPort=26818\nSlurmUser=root\n\
             AuthType=auth/none\nCredType=cred/none\nProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\n\
             SelectType=select/cons_tres\nSelectTypeParameters=CR_Core_Memory\nMpiDefault=none\nReturnToService=2\n\
             JobAcctGatherType=jobacct_gather/none\nAccountingStorageType=accounting_storage/none\nMinJobAge=300\n\
             StateSaveLocation={folder}/state\nSlurmdSpoolDir={folder}/spool\n\
             SlurmctldPidFile={folder}/slurmctld.pid\nSlurmdPidFile={folder}/slurmd.pid\n\
             SlurmctldLogFile={folder}/slurmctld.log\nSlurmdLogFile={folder}/slurmd.log\n\
             NodeName={node} NodeAddr=127.0.0.1 CPUs=2 RealMemory=4000 State=UNKNOWN\n\
             PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP\n"
        );
        std::fs::create_dir_all("/etc/slurm").unwrap();
        std::fs::write(SLURM_CONF, settings).unwrap_or_else(|e| panic!("{SLURM_CONF}: {e}; run these tests as root"));
        // No systemd here: the first version of control groups does without.
        std::fs::write(CGROUP_CONF, "CgroupPlugin=cgroup/v1\n").unwrap();
        let daemon = |name: &str| {
            let mut command = Command::new("setpriv");
            command.args(["--pdeathsig", "TERM", name, "-D"]).stdout(Stdio::null()).stderr(Stdio::null());
            command.spawn().unwrap_or_else(|e| panic!("{name}: {e}; `./run setup` installs it"))
        };
        let slurm = Self { daemons: vec![daemon("slurmctld"), daemon("slurmd")] };
        let begin = Instant::now();
        while !printed("sinfo", &["-h", "-o", "%T"]).contains("idle") {
            assert!(begin.elapsed() < Duration::from_secs(60), "Slurm's node is not idle: see {folder}");
            std::thread::sleep(Duration::from_millis(200));
        }
        slurm
    }
}

impl Drop for OneNodeSlurm {
    fn drop(&mut self) {
        for daemon in &mut self.daemons {
            daemon.kill().ok();
            daemon.wait().ok();
        }
        for file in [SLURM_CONF, CGROUP_CONF] {
            std::fs::remove_file(file).ok();
        }
    }
}

/// What a program prints.
pub fn printed(name: &str, arguments: &[&str]) -> String {
    let output = Command::new(name).args(arguments).output();
    let output = output.unwrap_or_else(|e| panic!("{name}: {e}; `./run setup` installs it"));
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

/// Starts the workflow in `folder` with this program; what it says goes to `snakemake.log` there.
pub fn snakemake(program: &Path, folder: &Path, profile: &str, raw: &Path, out: &Path, settings: &Path) -> Child {
    workflow(program, folder, profile, (raw, out), settings, &[])
}

/// The same with more words of its configuration.
pub fn workflow(
    program: &Path,
    folder: &Path,
    profile: &str,
    (raw, out): (&Path, &Path),
    settings: &Path,
    more: &[&str],
) -> Child {
    std::fs::create_dir_all(folder).unwrap();
    let pipeline = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/cohort");
    let log = std::fs::File::create(folder.join("snakemake.log")).unwrap();
    let mut command = Command::new(tool_path("snakemake"));
    command.arg("-s").arg(pipeline.join("Snakefile"));
    command.arg("--workflow-profile").arg(pipeline.join("profiles").join(profile));
    command.arg("--config").arg(format!("bids_dir={}", raw.display())).arg(format!("out={}", out.display()));
    command.arg(format!("settings={}", settings.display())).arg(format!("hgm={}", program.display()));
    command.args(more);
    command.current_dir(folder).env("HOME", folder);
    command.stdout(log.try_clone().unwrap()).stderr(log).spawn().unwrap()
}
