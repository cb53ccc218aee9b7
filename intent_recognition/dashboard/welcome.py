# SPDX-License-Identifier: Apache-2.0
"""First script in a browser that opens the page: decides whether it needs the light scene.

Software rendering takes seconds for a frame with shadows. The script times the drawing of a small
picture, unless the renderer's name says that it is software. If drawing is slow, the page gets a
third of the pixels (viser's `fixedDpr`), edges are not smoothed, viser's own environment light is
not decoded, and the server removes shadows.
"""

AUTO, ALWAYS, NEVER = "auto", "always", "never"
"""When the scene is light; auto: if a browser draws slowly. YAML reads on and off as booleans."""
PLAIN, LIGHT = "/", "/?fixedDpr=0.6"
TOLD = {"/plain": False, "/light": True}
"""Path with which a browser reports how it draws, and whether that means slowly."""
SLOW_MS = 12.0
"""Drawing time of the picture above which a browser is slow [ms]. Software rendering took 35 to 45
on two cores; a graphics processor needs one or two."""
MEASURE = """
let slow = true;
const gl = document.createElement("canvas").getContext("webgl2");
const named = gl && gl.getExtension("WEBGL_debug_renderer_info");
const renderer = named ? gl.getParameter(named.UNMASKED_RENDERER_WEBGL) : "";
if (gl && !/swiftshader|llvmpipe|software/i.test(renderer)) {
  const program = gl.createProgram();
  const add = (kind, text) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, "#version 300 es\\nprecision highp float;" + text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  };
  add(gl.VERTEX_SHADER, `void main() {
    gl_Position = vec4(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1, 0, 1);
  }`);
  add(gl.FRAGMENT_SHADER, `out vec4 colour;
  void main() {
    float x = gl_FragCoord.x;
    for (int k = 0; k < 100; k++) x = sin(x + gl_FragCoord.y);
    colour = vec4(x);
  }`);
  gl.linkProgram(program);
  gl.useProgram(program);
  let began;
  for (const size of [1, 300]) {  // the program is compiled for the first pixel
    gl.viewport(0, 0, size, size / 2);
    began = performance.now();
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
  slow = performance.now() - began > %s;
}
"""
GO_ON = f"""
history.replaceState(null, "", slow ? "{LIGHT}" : "{PLAIN}");
fetch(slow ? "/light" : "/plain");
const canvas = HTMLCanvasElement.prototype, context = canvas.getContext;
if (slow) canvas.getContext = function (kind, given) {{  // each smoothed pixel is drawn four times
  return context.call(this, kind, {{...given, antialias: false}});
}};
const load = window.fetch;
if (slow) window.fetch = function (wanted, given) {{  // viser asks before it hears of no light
  const light = String(wanted.url || wanted).startsWith("data:image/jpeg");
  return light ? new Promise(() => {{}}) : load.call(this, wanted, given);
}};
"""


def welcome(light: str, page: str) -> str:
    """The page with the script inserted first; `light` is `AUTO`, `ALWAYS` or `NEVER`."""
    first = MEASURE % SLOW_MS if light == AUTO else f"const slow = {light == ALWAYS:d};"
    return page.replace("<head>", f"<head><script>{first}{GO_ON}</script>", 1)
