"""MaterialX's own shader of a document, as a function `brdf`, and how far its values are from a model's.

It writes no document; the shader is the one that MaterialX's generator makes, under one light and no environment.
"""

import importlib
import importlib.util
import re
from typing import Any

from fitmat.errors import OutputError
from fitmat.exports.glsl import browser
from fitmat.exports.material import Chosen
from fitmat.exports.materialx.document import Document, xml
from fitmat.exports.verification import Difference, compared, directions, exact, run
from fitmat.models.base import evaluate

EVALUATE = """
vec3 brdf(vec3 wi, vec3 wo) {
    if (wi.z <= 0.0 || wo.z <= 0.0) {
        return vec3(0.0);
    }
    PLACED
    u_viewPosition = wo;
    u_numActiveLightSources = 1;
    u_lightData[0] = LightData(1, -wi, vec3(1.0), 1.0);
    generated();
    return out1.rgb / wi.z;
}
"""

PLACED = {"normalWorld": "vec3(0.0, 0.0, 1.0)", "tangentWorld": "vec3(1.0, 0.0, 0.0)", "positionWorld": "vec3(0.0)"}
"""The surface's frame: whichever of these a shader asks for."""

LEAST = 1e-14
"""Values in sr⁻¹ below this count as this."""


_DARK = re.compile(r"^(vec3 mx_environment_(?:ir)?radiance\([^)]*\))\s*\{.*?^\}", re.MULTILINE | re.DOTALL)
# What the environment sends.


def difference(chosen: Chosen, document: Document) -> Difference | None:
    """How far MaterialX's values are from the model's; None without MaterialX or a browser.

    Raises:
        OutputError: MaterialX refuses the document, or the browser does not run its shader.
    """
    program = browser.program()
    if program is None or importlib.util.find_spec("MaterialX") is None:
        return None
    wi, wo = directions()
    source, version = shader(document)
    (values,), executor = run([source], wi, wo, program)
    own = evaluate(chosen.model, *exact(wi, wo))
    return compared(values, own, wi, wo, f"MaterialX {version} ({executor})", least=LEAST)


def shader(document: Document) -> tuple[str, str]:
    """GLSL ES 3.00 of MaterialX's generator with a function `vec3 brdf(vec3 wi, vec3 wo)`, and the version.

    Raises:
        OutputError: the document is not valid.
    """
    names = ("MaterialX", "MaterialX.PyMaterialXGenGlsl", "MaterialX.PyMaterialXGenShader")
    modules: list[Any] = [importlib.import_module(name) for name in names]
    mx, glsl, generation = modules
    path, library = mx.getDefaultDataSearchPath(), mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), path, library)
    read = mx.createDocument()
    mx.readFromXmlString(read, xml(document))
    read.setDataLibrary(library)
    valid, why = read.validate()
    if not valid:
        raise OutputError(f"MaterialX {mx.getVersionString()} refuses the document ({why.strip()}).")
    generator = glsl.EsslShaderGenerator.create()
    context: Any = generation.GenContext(generator)
    context.registerSourceCodeSearchPath(path)
    options = context.getOptions()
    environments = generation.HwSpecularEnvironmentMethod
    options.hwSpecularEnvironmentMethod = environments.SPECULAR_ENVIRONMENT_FIS  # without one it does not compile
    options.hwMaxActiveLightSources = 1
    options.shaderInterfaceType = generation.ShaderInterfaceType.SHADER_INTERFACE_REDUCED
    light = library.getNodeDef("ND_directional_light")
    generation.HwShaderGenerator.bindLightShader(light, 1, context)
    element = generation.findRenderableElements(read)[0]
    made = generator.generate("material", element, context).getSourceCode(generation.PIXEL_STAGE)
    generation.HwShaderGenerator.unbindLightShaders(context)
    return _evaluating(made), mx.getVersionString()


def _evaluating(made: str) -> str:
    """A pixel shader as a function of two directions: what came from outside is set, and only the light is left."""
    text = re.sub(r"^#version.*$|^precision .*$", "", made, flags=re.MULTILINE)
    text = re.sub(r"^uniform (?:surfaceshader|displacementshader|sampler2D) .*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"^(?:uniform |in |out )(.*;)$", r"\1", text, flags=re.MULTILINE)
    text = _DARK.sub(r"\1 { return vec3(0.0); }", text)
    placed = "\n    ".join(f"{name} = {value};" for name, value in PLACED.items() if f"vec3 {name};" in text)
    return text.replace("void main()", "void generated()") + EVALUATE.replace("PLACED", placed)
