/* Surfaces to try the service with; the service simulates their measurement. */

/** Name, words, a CSS gradient, and the body of POST /v1/simulate. */
export const SAMPLES = [
  {
    name: "rough_copper.csv",
    title: "Rough copper",
    words: "Three colours, six incidences in the plane",
    colours: ["#3a1c10", "#b8693d", "#ffd9b8"],
    body: {
      model: "ggx:k_s=1",
      params: { k_d: [0.03, 0.015, 0.01], F0: [0.9555, 0.6377, 0.5379], alpha: 0.3 },
      geometry: "in-plane incidences=0,15,30,45,60,75 step=2 max=80 blind=4",
      noise: [0.02, 0.001],
      seed: 103,
    },
  },
  {
    name: "matte_paint.csv",
    title: "Matte paint",
    words: "Ochre pigment under a rough binder",
    colours: ["#6e5321", "#c9a45a", "#e8d3a0"],
    body: {
      model: "cook_torrance:k_s=1",
      params: { k_d: [0.62, 0.47, 0.24], F0: [0.04, 0.04, 0.04], alpha: 0.5 },
      geometry: "in-plane incidences=0,15,30,45,60,70 step=2.5 max=80 blind=5",
      noise: [0.01, 0.0005],
      seed: 101,
    },
  },
  {
    name: "brushed_steel.csv",
    title: "Brushed steel",
    words: "Anisotropic: the sample was turned",
    colours: ["#3c4247", "#a7b0b6", "#eef1f3"],
    body: {
      model: "ward",
      params: { k_d: 0.02, k_s: 0.52, alpha_x: 0.28, alpha_y: 0.09, phi_x: 0.31 },
      geometry: "in-plane incidences=10,30,50,65 azimuths=0,30,60,90,120,150 step=2 max=78 blind=4",
      noise: [0.03, 0.002],
      seed: 104,
    },
  },
  {
    name: "satin_varnish.csv",
    title: "Satin varnish",
    words: "Few, noisy views over the hemisphere",
    colours: ["#3b2313", "#8f5a30", "#d9b48a"],
    body: {
      model: "blinn_phong",
      params: { k_d: 0.18, k_s: 0.22, n: 30 },
      geometry: "hemisphere incidences=20,45,65 theta_step=12.5 phi_step=45 max=75",
      noise: [0.08, 0.002],
      seed: 106,
    },
  },
];
