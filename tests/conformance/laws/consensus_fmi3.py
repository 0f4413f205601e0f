"""The paper's law as an FMU of FMI 3.0: its model description, its build, and the file. It imports nothing of ours."""

from __future__ import annotations

import re
import subprocess
import zipfile
from pathlib import Path

import fmpy

NAME = "ConsensusFmi3"
INPUTS = ("T", "neighbours", *(f"own_{name}" for name in ("leader", "e", "z", "V", "P_set", "V_set", "m_p")))
PARAMETERS = {"k_p": "0.0007", "k_q": "0.25"}
OUTPUTS = ("P_set", "V_set")
OF_NEIGHBOUR = tuple(f"neighbour_{i}_{name}" for i in range(1, 17) for name in ("weight", "P_set", "Q", "m_p", "m_q"))
NAMES = ("time", *INPUTS, *PARAMETERS, *OUTPUTS, *OF_NEIGHBOUR)
"""Variables in the order of their value references, which consensus_fmi3.c has as well."""


def described(kind: str = "Float64") -> str:
    """Return the text of modelDescription.xml; `kind` is the type of the input own_leader."""
    variables = []
    for reference, name in enumerate(NAMES):
        about = f'name="{name}" valueReference="{reference}"'
        if name == "time":
            about += ' causality="independent" variability="continuous"'
        elif name in PARAMETERS:
            about += f' causality="parameter" variability="tunable" start="{PARAMETERS[name]}"'
        elif name in OUTPUTS:
            about += ' causality="output" variability="discrete"'
        else:
            about += ' causality="input" variability="discrete" start="0"'
        variables.append(f"<{kind if name == 'own_leader' else 'Float64'} {about}/>")
    outputs = "".join(f'<Output valueReference="{NAMES.index(name)}"/>' for name in OUTPUTS)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="3.0" modelName="{NAME}" instantiationToken="consensus-fmi3">'
        f'<CoSimulation modelIdentifier="{NAME}" canHandleVariableCommunicationStepSize="true"/>'
        f"<ModelVariables>{''.join(variables)}</ModelVariables>"
        f"<ModelStructure>{outputs}</ModelStructure></fmiModelDescription>\n"
    )


def build(cc: str, folder: Path) -> str:
    """Compile the law with the headers that fmpy ships, and pack it; return the name of the file."""
    library = folder / f"{NAME}{fmpy.sharedLibraryExtension}"
    headers = Path(fmpy.__file__).parent / "c-code"
    source = Path(__file__).with_suffix(".c")
    declared = re.findall(r"^#define (fmi3\w+) +fmi3FullName", (headers / "fmi3Functions.h").read_text(), re.MULTILINE)
    written = re.findall(r"^fmi3\w+ (fmi3\w+)\(|^void (fmi3\w+)\(", source.read_text(), re.MULTILINE)
    rest = folder / "rest.c"  # an FMU exports every function of the standard; those that it does not need fail
    missing = sorted(set(declared) - {name for names in written for name in names})
    rest.write_text("".join(f"int {name}(void);\nint {name}(void) {{ return 3; }}\n" for name in missing))
    options = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-Wall", "-Wextra", "-Werror")
    subprocess.run([cc, *options, f"-I{headers}", str(source), str(rest), "-o", str(library), "-lm"], check=True)
    with zipfile.ZipFile(folder / f"{NAME}.fmu", "w") as packed:
        packed.writestr("modelDescription.xml", described())
        packed.write(library, f"binaries/{fmpy.platform_tuple}/{library.name}")
    return f"{NAME}.fmu"
