# SPDX-License-Identifier: Apache-2.0
"""The answer to the address with the token: it goes on to the page, the light one where that helps.

By software a frame with shadows takes seconds. Before the page is opened, a small picture is drawn
and timed. Where that is slow, the page is opened with a quarter of the pixels (viser's `fixedDpr`),
by which the server knows that shadows and the light of an environment must go.
"""

AUTO, ALWAYS, NEVER = "auto", "always", "never"
"""When the scene is light; auto: where a browser draws slowly. On and off are booleans in YAML."""
PLAIN, LIGHT = "/", "/?fixedDpr=0.5"
SLOW_MS = 12.0
"""Time of the picture from which on drawing is slow [ms]. By software it took 35 to 45 on two
cores; a graphics processor needs one or two."""
MEASURE = """
let slow = true;
const gl = document.createElement("canvas").getContext("webgl2");
if (gl) {
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
  for (let k = 0; k < 2; k++) {  // the first time the program is compiled
    began = performance.now();
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
  slow = performance.now() - began > %s;
}
location.replace(slow ? "%s" : "%s");
"""


def welcome(light: str) -> str:
    """The page that goes on; `light` is `AUTO`, `ALWAYS` or `NEVER`."""
    head = "<!doctype html><title>opening</title>"
    if light == AUTO:
        return f"{head}<script>{MEASURE % (SLOW_MS, LIGHT, PLAIN)}</script>"
    return (
        f'{head}<meta http-equiv="refresh" content="0;url={LIGHT if light == ALWAYS else PLAIN}">'
    )
