// Sky and sea: one shader each, sharing the sky so that the horizon closes.

import { BackSide, Mesh, PlaneGeometry, ShaderMaterial, SphereGeometry, Vector2, Vector3 } from "three";

export const SUN = new Vector3(-0.46, 0.5, -0.73).normalize();
export const HAZE = "#d6e6ef";
export const HAZE_DENSITY = 1 / 4200;

const SKY = /* glsl */ `
  uniform vec3 sun;
  float hash(vec2 p) { return fract(sin(dot(p, vec2(127.1, 311.7))) * 43758.5453); }
  float noise(vec2 p) {
    vec2 i = floor(p), f = fract(p), u = f * f * (3.0 - 2.0 * f);
    return mix(mix(hash(i), hash(i + vec2(1, 0)), u.x), mix(hash(i + vec2(0, 1)), hash(i + vec2(1, 1)), u.x), u.y);
  }
  vec3 sky(vec3 d) {
    float h = max(d.y, 0.0);
    vec3 c = mix(vec3(0.84, 0.90, 0.935), vec3(0.60, 0.765, 0.885), smoothstep(0.0, 0.28, h));
    c = mix(c, vec3(0.36, 0.57, 0.77), smoothstep(0.2, 0.95, h));
    float s = max(dot(d, sun), 0.0);
    return c + vec3(1.0, 0.93, 0.8) * (0.16 * pow(s, 6.0) + 0.22 * pow(s, 60.0));
  }`;

const SKY_VERTEX = /* glsl */ `
  varying vec3 d;
  void main() {
    d = position;
    vec4 p = projectionMatrix * vec4(mat3(modelViewMatrix) * position, 1.0);
    gl_Position = p.xyww;
  }`;

const SKY_FRAGMENT = /* glsl */ `
  varying vec3 d;
  ${SKY}
  void main() {
    vec3 n = normalize(d), c = sky(n);
    vec2 p = n.xz / (n.y + 0.12);
    float f = 0.5 * noise(p * 1.3) + 0.25 * noise(p * 2.9 + 7.0) + 0.13 * noise(p * 6.1) + 0.07 * noise(p * 13.0);
    float cloud = smoothstep(0.46, 0.8, f) * smoothstep(0.015, 0.2, n.y) * 0.62;
    gl_FragColor = vec4(mix(c, vec3(0.97, 0.98, 0.99), cloud), 1.0);
  }`;

const SEA_VERTEX = /* glsl */ `
  uniform vec2 centre;
  varying vec3 at;
  void main() {
    vec4 p = modelMatrix * vec4(position, 1.0);
    at = vec3(p.xyz);
    gl_Position = projectionMatrix * viewMatrix * p;
  }`;

// waves: a sum of sharpened sines, each dragged along by the ones before; a wave shorter than a pixel fades out and
// makes the surface rougher instead
const SEA_FRAGMENT = /* glsl */ `
  uniform float time, steep;
  uniform vec2 towards;
  uniform float haze;
  varying vec3 at;
  ${SKY}
  void main() {
    vec3 eye = cameraPosition - at;
    float far = length(eye);
    vec3 v = eye / far;
    float pixel = max(length(dFdx(at.xz)), length(dFdy(at.xz)));
    vec2 p = at.xz, slope = vec2(0.0);
    float k = 0.13, weight = 1.0, angle = 0.0, lost = 0.0, crest = 0.0;
    for (int i = 0; i < 17; i++) {
      vec2 d = normalize(vec2(sin(angle), cos(angle)) + towards * (i < 7 ? 1.1 : 0.35));
      float x = dot(d, p) * k + time * sqrt(9.81 * k) * -1.0 + float(i) * 1.7;
      float w = exp(sin(x) - 1.0), g = w * cos(x);
      float keep = 1.0 - smoothstep(0.35, 1.6, pixel * k);
      slope += d * g * weight * keep;
      crest += w * weight * keep * (i < 8 ? 1.0 : 0.0);
      lost += weight * weight * (1.0 - keep);
      p -= d * g * weight * 0.42 / k;
      angle += 2.399;
      k *= 1.33;
      weight *= 0.885;
    }
    // ripples, which break up what is too regular
    float near = 1.0 - smoothstep(0.06, 0.5, pixel);
    vec2 q = at.xz * 1.7 + towards * time * 0.9;
    slope += near * 1.3 * (vec2(noise(q), noise(q + 19.0)) - 0.5) + near * 1.1 * (vec2(noise(q * 3.1 - time), noise(q * 3.1 + 41.0)) - 0.5);
    slope *= steep;
    float rough = 0.0016 + 0.10 * steep * steep * lost;
    // gusts: patches of ruffled and of smoother water
    float gust = noise(at.xz * 0.0045 + time * 0.01) * 0.65 + noise(at.xz * 0.017) * 0.35;
    slope *= 0.72 + 0.56 * gust;
    vec3 n = normalize(vec3(-slope.x, 1.0, -slope.y));
    float cosine = max(dot(n, v), 0.0);
    float fresnel = 0.02 + 0.98 * pow(1.0 - cosine, 5.0) / (1.0 + 26.0 * rough);
    vec3 r = reflect(-v, n);
    r.y = abs(r.y) + 0.06 + 1.2 * rough;
    vec3 deep = vec3(0.05, 0.235, 0.345), light = vec3(0.125, 0.42, 0.495);
    float up = clamp(0.26 + 0.055 * crest + 0.5 * dot(n.xz, sun.xz) + 0.16 * (gust - 0.5), 0.0, 1.0);
    vec3 c = mix(mix(deep, light, up), sky(normalize(r)), fresnel);
    // glitter of the sun
    vec3 half_way = normalize(v + sun);
    float tilt = (1.0 - pow(max(dot(n, half_way), 0.0), 2.0)) / max(pow(dot(n, half_way), 2.0), 1e-3);
    float glint = exp(-tilt / (rough * 2.0 + 0.016)) / (1.0 + 20.0 * rough);
    c += vec3(1.0, 0.95, 0.86) * 0.34 * glint;
    float f = 1.0 - exp(-pow(far * haze, 1.35));
    c = mix(c, sky(normalize(vec3(-v.x, 0.0, -v.z))), f);
    gl_FragColor = vec4(c, 1.0);
  }`;

export function makeSky() {
  const material = new ShaderMaterial({
    vertexShader: SKY_VERTEX, fragmentShader: SKY_FRAGMENT, uniforms: { sun: { value: SUN } }, side: BackSide, depthWrite: false, depthTest: false,
  });
  const sky = new Mesh(new SphereGeometry(1, 24, 16), material);
  sky.renderOrder = -100;
  sky.frustumCulled = false;
  return sky;
}

/** The sea writes no depth: what lies flat on it never fights with it, and nothing is drawn below y = 0. */
export function makeSea() {
  const uniforms = {
    sun: { value: SUN }, time: { value: 0 }, steep: { value: 0.05 }, towards: { value: new Vector2(1, 0) }, haze: { value: HAZE_DENSITY },
  };
  const material = new ShaderMaterial({ vertexShader: SEA_VERTEX, fragmentShader: SEA_FRAGMENT, uniforms, depthWrite: false });
  const sea = new Mesh(new PlaneGeometry(60000, 60000, 60, 60).rotateX(-Math.PI / 2), material);
  sea.renderOrder = -90;
  sea.frustumCulled = false;
  return sea;
}
