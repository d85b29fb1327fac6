# hairbake as a package of rez (https://rez.readthedocs.io). Building it needs a package `rust` that brings
# cargo.
#
#     cd pipeline/rez && rez build --install
#     rez env hairbake -- hairbake --help

name = "hairbake"
version = "0.1.0"
description = "Bakes hair: a groom on a moving head becomes a USD curve cache."
tools = ["hairbake"]
private_build_requires = ["rust"]
build_command = "test -z '{install}' || cargo install --locked --path {root}/../.. --root {install_path}"


def commands():
    env.PATH.append("{root}/bin")
