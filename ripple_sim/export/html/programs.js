// Programs and textures of WebGL 2.

// Whether WebGL runs on the processor, where every pixel costs.
function drawsInSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl && gl.getExtension("WEBGL_debug_renderer_info");
  return info ? /swiftshader|llvmpipe|software/i.test(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : false;
}

// A program with what is defined, and `set`, which takes its uniforms by their names.
function programOf(gl, vertex, fragment, defined = []) {
  const program = gl.createProgram();
  const head = [
    "#version 300 es",
    ...defined.map(name => `#define ${name}`),
    "precision highp float;",
    "precision highp int;",
    "precision highp sampler2DShadow;",
  ];
  for (const [kind, source] of [
    [gl.VERTEX_SHADER, vertex],
    [gl.FRAGMENT_SHADER, fragment],
  ]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, head.join("\n") + source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  return {program, set: settersOf(gl, program)};
}

// The source of a shader that the page has as a file.
function shaderOf(name) {
  return document.getElementById(name).textContent;
}

function settersOf(gl, program) {
  const setters = {};
  const kinds = {
    [gl.FLOAT]: "uniform1fv",
    [gl.FLOAT_VEC2]: "uniform2fv",
    [gl.FLOAT_VEC3]: "uniform3fv",
    [gl.FLOAT_VEC4]: "uniform4fv",
  };
  for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
    const {name, type} = gl.getActiveUniform(program, i);
    const place = gl.getUniformLocation(program, name);
    const kind = kinds[type];
    setters[name.replace("[0]", "")] =
      type === gl.FLOAT_MAT4
        ? value => gl.uniformMatrix4fv(place, false, value)
        : kind
          ? value => gl[kind](place, [value].flat(2))
          : value => gl.uniform1i(place, value);
  }
  return values => {
    for (const [name, value] of Object.entries(values)) if (name in setters) setters[name](value);
  };
}

// A texture of an image, which repeats.
function imageTexture(gl, image, software) {
  const smooth = {
    MIN_FILTER: software ? "LINEAR_MIPMAP_NEAREST" : "LINEAR_MIPMAP_LINEAR",
    MAG_FILTER: "LINEAR",
  };
  const texture = tableOf(gl, "RGBA8", 0, 0, {...smooth, WRAP_S: "REPEAT", WRAP_T: "REPEAT"}, 0);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
  gl.generateMipmap(gl.TEXTURE_2D);
  return texture;
}

// A row of colours as a texture.
function colorsTexture(gl, colors) {
  const texture = tableOf(gl, "RGBA8", colors.length, 1, LINEAR);
  gl.texSubImage2D(
    gl.TEXTURE_2D,
    0,
    0,
    0,
    colors.length,
    1,
    gl.RGBA,
    gl.UNSIGNED_BYTE,
    new Uint8Array(colors.flatMap(c => [...c, 255])),
  );
  return texture;
}

// A texture of a format such as RGBA8, which stays bound, without filters where its parameters name none.
const LINEAR = {MIN_FILTER: "LINEAR", MAG_FILTER: "LINEAR"};
function tableOf(gl, format, width, height, parameters = {}, levels = 1) {
  const texture = gl.createTexture();
  const all = {
    MIN_FILTER: "NEAREST",
    MAG_FILTER: "NEAREST",
    WRAP_S: "CLAMP_TO_EDGE",
    WRAP_T: "CLAMP_TO_EDGE",
    ...parameters,
  };
  gl.bindTexture(gl.TEXTURE_2D, texture);
  if (levels) gl.texStorage2D(gl.TEXTURE_2D, levels, gl[format], width, height);
  for (const [name, value] of Object.entries(all))
    gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${name}`], gl[value]);
  return texture;
}

// What draws into textures, by attachments such as COLOR_ATTACHMENT0.
function framebufferOf(gl, textures) {
  const framebuffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  for (const [attachment, texture] of Object.entries(textures))
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl[attachment], gl.TEXTURE_2D, texture, 0);
  return framebuffer;
}
