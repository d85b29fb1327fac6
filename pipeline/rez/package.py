# hairbake's wheel as a package of rez (https://rez.readthedocs.io). Building it needs a package `rust` that
# brings cargo and rustc, and Python 3.11 or newer with pip as `python3`. The Python that runs it needs NumPy,
# and usd-core to read USD and to validate: require your packages of them beside this one.
#
#     cd pipeline/rez && rez build --install
#     rez env hairbake -- hairbake --help

name = "hairbake"
version = "0.1.0"
description = "Bakes hair: a groom on a moving head becomes a USD curve cache."
tools = ["hairbake"]
private_build_requires = ["rust"]
build_command = "test -z '{install}' || python3 -m pip install --no-deps --target {install_path} {root}/../.."


def commands():
    env.PATH.append("{root}/bin")
    env.PYTHONPATH.append("{root}")
