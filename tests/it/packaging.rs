//! Containers and release, without a container engine: the recipes' steps are read, and what can be run of them is run.

use crate::docs::root;
use crate::job::{contents, output, program, sample};
use crate::python::python_file;
use serde_json::Value;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

fn read(name: &str) -> String {
    std::fs::read_to_string(root().join(name)).unwrap()
}

fn script(path: &Path, text: &str) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, text).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

fn stdout(ended: &Output) -> String {
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    String::from_utf8(ended.stdout.clone()).unwrap()
}

#[test]
fn the_entry_point_hands_the_words_of_a_bids_app_on_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    script(&folder.path().join("hgm"), "#!/bin/sh\nprintf '[%s]' \"$@\"\n");
    let path = format!("{}:{}", folder.path().display(), std::env::var("PATH").unwrap());
    let handed = |words: &[&str]| {
        let entry = root().join("packaging/hgm-bids");
        stdout(&Command::new(entry).args(words).env("PATH", &path).output().unwrap())
    };
    let words = ["/data", "/my out", "participant", "--participant-label", "01", "02"];
    assert_eq!(handed(&words), "[bids][/data][/my out][participant][--participant-label][01][02]");
    assert_eq!(handed(&["/data", "/out", "group"]), "[bids][/data][/out][group]");
    assert_eq!(handed(&["--version"]), "[--version]");
    assert_eq!(handed(&["--help"]), "[bids][--help]");
    assert_eq!(handed(&["hgm", "warp", "a b"]), "[warp][a b]");
}

/// The words behind `NAME="..."` in the script of both recipes.
fn packages(name: &str) -> Vec<String> {
    let text = read("packaging/in-container");
    let line = text.lines().find_map(|line| line.strip_prefix(&format!("{name}=\""))).unwrap();
    line.trim_end_matches('"').split_whitespace().map(str::to_owned).collect()
}

#[test]
fn both_recipes_take_the_same_steps_on_the_compiler_that_we_ask_for() {
    let (docker, apptainer) = (read("packaging/Dockerfile"), read("packaging/hgm.def"));
    let cargo: toml::Table = read("Cargo.toml").parse().unwrap();
    let compiler = cargo["package"]["rust-version"].as_str().unwrap();
    for recipe in [&docker, &apptainer] {
        assert!(recipe.contains(&format!("rust:{compiler}-bookworm")), "the base image has another compiler");
        for step in ["in-container build /source /out", "in-container packages", "/usr/local/bin/hgm-bids", "HGM_CGAL"]
        {
            assert!(recipe.contains(step), "no `{step}` in\n{recipe}");
        }
        // Nothing is fetched past Debian's packages and the crates of Cargo.lock.
        assert!(!["curl", "wget", "ADD ", "git clone"].iter().any(|fetch| recipe.contains(fetch)));
    }
    assert!(docker.contains("USER 1000:1000") && !docker.contains("USER root"));
    // What is left out of the copied sources is nothing that git keeps.
    let ignored: Vec<String> = read(".dockerignore").lines().map(str::to_owned).collect();
    let kept = stdout(&Command::new("git").args(["ls-files"]).current_dir(root()).output().unwrap());
    assert!(kept.lines().all(|file| !ignored.iter().any(|name| file == name || file.starts_with(&format!("{name}/")))));
}

#[test]
fn the_packages_that_the_recipes_install_are_debians() {
    for package in packages("BUILD_PACKAGES").iter().chain(&packages("RUN_PACKAGES")) {
        let installed = Command::new("dpkg-query").args(["-W", package]).output().unwrap().status.success();
        let known = || stdout(&Command::new("apt-cache").args(["policy", package]).output().unwrap());
        assert!(installed || known().contains("Candidate: "), "{package}");
    }
}

/// The shared libraries of a program with the packages they are from.
fn libraries(program: &Path) -> Vec<(String, String)> {
    let told = stdout(&Command::new("ldd").arg(program).output().unwrap());
    let path = |line: &str| line.split_whitespace().find(|word| word.starts_with('/')).map(str::to_owned);
    let owner = |file: String| {
        // Debian's list has some libraries below /usr, which /lib is a link to.
        let names = [file.clone(), format!("/usr{file}"), file.trim_start_matches("/usr").to_owned()];
        let asked =
            |name: &String| Command::new("dpkg").args(["-S", name]).output().ok().filter(|out| out.status.success());
        let told = names.iter().find_map(asked).unwrap_or_else(|| panic!("whose is {file}?"));
        (file, String::from_utf8(told.stdout).unwrap().split(':').next().unwrap().to_owned())
    };
    told.lines().filter_map(path).map(owner).collect()
}

#[test]
fn the_image_laid_into_an_empty_folder_runs_without_root_and_without_a_network() {
    let folder = tempfile::tempdir().unwrap();
    let image = folder.path().join("image");
    let Some(mesher) = std::env::var_os("HGM_CGAL_MESHER") else {
        panic!("`./run test` builds the CGAL mesher and says where")
    };
    let ended = Command::new("sh")
        .args([
            root().join("packaging/in-container").as_os_str(),
            "place".as_ref(),
            root().as_os_str(),
            image.as_os_str(),
        ])
        .args([program().as_os_str(), &mesher])
        .output()
        .unwrap();
    stdout(&ended);
    let names: Vec<String> = contents(&image).into_keys().collect();
    for wanted in ["usr/share/hgm/LICENSE-MIT", "usr/share/hgm/atlases/mni152/LICENSE", "usr/share/hgm/cgal/README.md"]
    {
        assert!(names.iter().any(|name| name == wanted), "{wanted} is not in the image");
    }
    // What Apptainer copies from the first stage is what is laid there.
    for line in read("packaging/hgm.def").lines().filter_map(|line| line.trim().strip_prefix("/out/")) {
        assert!(image.join(line.split(' ').next().unwrap()).exists(), "{line}");
    }
    // The base image's shell and C library, and the libraries of the packages that the recipe installs: nothing else.
    let listed = packages("RUN_PACKAGES");
    for (program, base) in [("usr/local/bin/hgm", false), ("usr/local/bin/hgm-cgal-mesher", false), ("bin/sh", true)] {
        let place = image.join(program);
        if base {
            std::fs::create_dir_all(place.parent().unwrap()).unwrap();
            std::fs::copy("/bin/sh", &place).unwrap();
        }
        for (library, package) in libraries(&place) {
            assert!(package == "libc6" || base || listed.contains(&package), "{program} needs {library} of {package}");
            let to = image.join(library.trim_start_matches('/'));
            std::fs::create_dir_all(to.parent().unwrap()).unwrap();
            std::fs::copy(&library, to).unwrap();
        }
    }
    for (session, scan) in [("preop", "pre.nii.gz"), ("postop", "post.nii.gz")] {
        let anat = image.join(format!("data/sub-01/ses-{session}/anat"));
        std::fs::create_dir_all(&anat).unwrap();
        std::fs::copy(sample(scan), anat.join(format!("sub-01_ses-{session}_T1w.nii.gz"))).unwrap();
    }
    std::fs::create_dir_all(image.join("tmp")).unwrap();
    let open = std::fs::Permissions::from_mode(0o755);
    for path in [folder.path(), &image] {
        std::fs::set_permissions(path, open.clone()).unwrap();
    }
    let inside = |words: &[&str]| {
        let root_user = stdout(&Command::new("id").arg("-u").output().unwrap()).trim() == "0";
        let mut command = Command::new("unshare");
        command.args(if root_user { &["-n", "chroot", "--userspec=1000:1000"][..] } else { &["-rn", "chroot"] });
        command.arg(&image).args(words).env_clear().env("PATH", "/usr/bin:/usr/sbin:/bin:/sbin:/usr/local/bin");
        command.env("HGM_CGAL_MESHER", "/usr/local/bin/hgm-cgal-mesher").output().unwrap()
    };
    let entry = "/usr/local/bin/hgm-bids";
    assert!(stdout(&inside(&[entry, "--version"])).starts_with("hgm "));
    let planned = stdout(&inside(&[entry, "/data", "/out", "participant", "--dry-run", "--json"]));
    let planned: Value = serde_json::from_str(&planned).unwrap();
    assert_eq!(planned["subjects"][0]["participant_id"], "sub-01", "{planned}");
    assert!(stdout(&inside(&[entry, "hgm", "doctor"])).contains("/usr/local/bin/hgm-cgal-mesher"));
    // The mesher gets as far as to read: its libraries are there.
    let mesher = inside(&["/usr/local/bin/hgm-cgal-mesher"]);
    let said = String::from_utf8_lossy(&mesher.stderr).into_owned();
    assert!(mesher.status.code() != Some(127) && !said.contains("shared libraries"), "{said}");
}

#[test]
fn the_descriptor_offers_what_the_command_offers() {
    let descriptor: Value = serde_json::from_str(&read("packaging/boutiques.json")).unwrap();
    let flags: Vec<&str> = descriptor["inputs"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|input| input["command-line-flag"].as_str())
        .collect();
    let help = stdout(&output(&["bids", "--help"]));
    let offered = |line: &str| {
        let words = line.trim_start();
        let option = words.starts_with('-').then(|| words.split([' ', ',']).find(|word| word.starts_with("--")))?;
        option.map(|option| option.trim_end_matches("...").to_owned())
    };
    let offered: Vec<String> = help.lines().filter_map(offered).filter(|option| option != "--help").collect();
    assert!(offered.len() > 20);
    for option in &offered {
        assert!(flags.contains(&option.as_str()), "{option} is missing");
    }
    assert!(flags.iter().all(|flag| offered.iter().any(|option| option == flag)), "{flags:?} {offered:?}");
}

#[test]
fn the_list_of_licences_has_every_crate_that_is_compiled_in_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let (code, said, complaint) = python_file(folder.path(), "packaging/sbom.py", &[]);
    assert_eq!(code, 0, "{complaint}");
    let list: Value = serde_json::from_str(&said).unwrap();
    let components = list["components"].as_array().unwrap();
    let names: Vec<&str> = components.iter().map(|component| component["name"].as_str().unwrap()).collect();
    for wanted in ["clap", "faer", "nifti", "rayon", "atlases/mni152", "atlases/head", "hgm-cgal-mesher"] {
        assert!(names.contains(&wanted), "{wanted}");
    }
    // Of the tests, and what only runs while something is compiled.
    assert!(!["insta", "proptest", "autocfg"].iter().any(|other| names.contains(other)));
    let cargo: toml::Table = read("Cargo.toml").parse().unwrap();
    for dependency in cargo["dependencies"].as_table().unwrap().keys() {
        assert!(names.contains(&dependency.as_str()), "{dependency}");
    }
    assert_eq!(names.contains(&"pyo3"), root().join("python/Cargo.toml").exists(), "what the wheel adds");
    // Each once, and what each needs is itself in the list.
    let references: Vec<&str> = components.iter().map(|component| component["bom-ref"].as_str().unwrap()).collect();
    let own = list["metadata"]["component"]["bom-ref"].as_str().unwrap();
    assert_eq!(references.iter().collect::<std::collections::BTreeSet<_>>().len(), references.len());
    for needed in list["dependencies"].as_array().unwrap() {
        for one in needed["dependsOn"].as_array().unwrap() {
            assert!(references.contains(&one.as_str().unwrap()) && one != own, "{one}");
        }
    }
    for component in components.iter().filter(|component| component["type"] == "library") {
        assert!(component["licenses"][0]["expression"].is_string(), "{component}");
        assert_eq!(component["hashes"][0]["content"].as_str().map(str::len), Some(64), "{component}");
    }
}

#[test]
fn a_release_has_program_wheel_recipes_licences_and_checksums_and_refuses_a_program_that_is_not_static() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // In place of ten minutes of compiling: a program that says its version; in place of a wheel's: a file.
    std::fs::write(
        at("hgm.c"),
        concat!("#include <stdio.h>\nint main(void) { puts(\"hgm ", env!("CARGO_PKG_VERSION"), "\"); }\n"),
    )
    .unwrap();
    let build = |link: &str| {
        let program = at("target/x86_64-unknown-linux-gnu/release/hgm");
        let (to, source) = (program.display(), at("hgm.c").display().to_string());
        format!(
            "#!/bin/sh\nif [ \"$1\" = build ]; then mkdir -p \"$(dirname {to})\" && exec gcc {link} -o {to} {source}; fi\n\
             exec \"$CARGO\" \"$@\"\n"
        )
    };
    let python = "#!/bin/sh\nif [ \"$2\" = pip ]; then while [ \"$1\" != --wheel-dir ]; do shift; done\n\
                  exec touch \"$2/hgm-0-py3-none-any.whl\"; fi\nexec \"$REAL_PYTHON\" \"$@\"\n";
    script(&at("bin/python3"), python);
    let real = stdout(&Command::new("sh").args(["-c", "command -v python3"]).output().unwrap());
    let release = || {
        Command::new("bash")
            .arg(root().join("packaging/release.sh"))
            .arg(at("out"))
            .env("PATH", format!("{}:{}", at("bin").display(), std::env::var("PATH").unwrap()))
            .env("CARGO_TARGET_DIR", at("target"))
            .env("CARGO", std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
            .env("REAL_PYTHON", real.trim())
            .env("HGM_RELEASE_UNCOMMITTED", "1")
            .output()
            .unwrap()
    };
    script(&at("bin/cargo"), &build("-O0"));
    let refused = release();
    assert!(!refused.status.success() && !at("out").exists());
    assert!(String::from_utf8_lossy(&refused.stderr).contains("is not static"), "{refused:?}");

    script(&at("bin/cargo"), &build("-static-pie"));
    stdout(&release());
    let made = contents(&at("out"));
    let version = env!("CARGO_PKG_VERSION");
    let mut wanted = vec![
        "SHA256SUMS".to_owned(),
        format!("hgm-{version}-containers.tar.gz"),
        format!("hgm-{version}-x86_64-linux"),
        format!("hgm-{version}.cdx.json"),
    ];
    if root().join("pyproject.toml").exists() {
        wanted.push("hgm-0-py3-none-any.whl".to_owned());
    }
    wanted.sort();
    assert_eq!(made.keys().cloned().collect::<Vec<_>>(), wanted);
    let sums = String::from_utf8(made["SHA256SUMS"].clone()).unwrap();
    assert_eq!(sums.lines().count(), wanted.len() - 1);
    let held = Command::new("sha256sum").args(["--check", "--quiet", "SHA256SUMS"]).current_dir(at("out")).status();
    assert!(held.unwrap().success());
    let first = made;
    stdout(&release());
    let again = contents(&at("out"));
    for name in wanted.iter().filter(|name| name.ends_with("json") || name.ends_with("tar.gz")) {
        assert!(first[name] == again[name], "{name} differs from one release to the next");
    }
}
