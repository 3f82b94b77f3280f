// The strip: hook, drum and load of each station, moving together, from the data beside them.
(() => {
  const make = (parent, tag, fields) => {
    const found = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(fields)) found.setAttribute(name, value);
    parent.append(found);
    return found;
  };
  const REST = { hook: 78, load: 222 };
  const TRACE = { left: 150, right: 312 };

  function station(svg, data, scale) {
    const reach = TRACE.right - TRACE.left;
    const path = (values, rest) =>
      values.map((v, k) => `${k ? "L" : "M"}${(TRACE.left + (reach * k) / (values.length - 1)).toFixed(1)} ` +
        `${(rest - scale * v).toFixed(1)}`).join("");
    make(svg, "rect", { class: "water", x: 0, y: 92, width: 320, height: 208 });
    for (const rest of Object.values(REST)) make(svg, "path", { class: "rest", d: `M8 ${rest}H312` });
    make(svg, "path", { class: "trace hook", d: path(data.hook, REST.hook) });
    make(svg, "path", { class: "trace after", d: path(data.load, REST.load) });
    make(svg, "text", { x: TRACE.left, y: 16 }).textContent = "hook";
    make(svg, "text", { x: TRACE.left, y: 168 }).textContent = "load, to the same scale";
    make(svg, "path", { class: "steel", d: `M312 ${284 - scale}V284` });
    make(svg, "text", { x: 304, y: 284, "text-anchor": "end" }).textContent = "1 m";
    const cursor = make(svg, "path", { class: "cursor", d: "M0 20V290" });
    const rope = make(svg, "path", { class: "rope" });
    const load = make(svg, "rect", { class: "load", x: 95, width: 26, height: 22 });
    const ship = make(svg, "g", {});
    make(ship, "path", { class: "hull", d: "M8 0H92L80 18H18Z" });
    make(ship, "path", { class: "steel", d: "M78 0L108 -14" });
    make(ship, "path", { class: "rope", d: "M52 -30L108 -14" });
    make(ship, "circle", { class: "wheel", cx: 52, cy: -14, r: 15 });
    const spokes = [0, 120, 240].map((angle) => [angle, make(ship, "path", { class: "spoke", d: "M52 -14V-28" })]);
    return (time) => {
      const at = Math.min(time / data.step, data.hook.length - 1.001);
      const k = Math.max(0, Math.floor(at));
      const between = (values) => values[k] + (at - k) * (values[k + 1] - values[k]);
      const hook = REST.hook - scale * between(data.hook);
      const place = REST.load - scale * between(data.load);
      ship.setAttribute("transform", `translate(0 ${(hook + 14).toFixed(2)})`);
      rope.setAttribute("d", `M108 ${hook.toFixed(2)}V${place.toFixed(2)}`);
      load.setAttribute("y", place.toFixed(2));
      const turned = (between(data.turn) * 180) / Math.PI;
      for (const [angle, spoke] of spokes)
        spoke.setAttribute("transform", `rotate(${(angle + turned).toFixed(1)} 52 -14)`);
      const x = TRACE.left + (reach * at) / (data.hook.length - 1);
      cursor.setAttribute("d", `M${x.toFixed(1)} 20V290`);
    };
  }

  function begin(element) {
    element.dataset.begun = "yes";
    const root = element.parentElement;
    const data = JSON.parse(element.textContent);
    const scenes = [...root.querySelectorAll(".scene")];
    if (!scenes.length) return;
    const highest = Math.max(0.02, ...data.flatMap((one) => [...one.hook, ...one.load].map(Math.abs)));
    const draw = scenes.map((svg, k) => station(svg, data[k], Math.min(52 / highest, 400)));
    const whole = data[0].step * (data[0].hook.length - 1);
    let time = 0, last = null;
    let playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    const button = document.querySelector(".strip-play");
    const tell = () => {
      if (button) button.setAttribute("aria-pressed", String(playing));
      root.dataset.time = time.toFixed(2);
    };
    if (button) button.onclick = () => { playing = !playing; last = null; tell(); };
    const frame = (now) => {
      if (!element.isConnected) return;
      if (playing && last !== null) time = (time + (now - last) / 1000) % whole;
      last = now;
      for (const move of draw) move(time);
      tell();
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  // Sliders and boxes: the server says where they stand, and between they follow each other.
  const shown = (value) => String(Number(Number(value).toPrecision(5)));
  const spoken = (slider, text) => slider.setAttribute("aria-valuetext", `${text} ${slider.dataset.unit ?? ""}`.trim());
  function place(input) {
    input.dataset.placed = "yes";
    input.value = input.dataset.value;
    if (input.type === "range") spoken(input, input.dataset.value);
  }
  function follow(event) {
    const control = event.target.closest?.(".control");
    if (!control) return;
    const [text, slider] = ["text", "range"].map((type) => control.querySelector(`input[type=${type}]`));
    if (event.target === slider) text.value = shown(slider.value);
    else if (event.type === "change") {
      // Beyond the end of the slider a number may be typed: the slider grows with it.
      const value = Number(text.value.replace(",", "."));
      if (!Number.isFinite(value)) return;
      if (value > Number(slider.max)) slider.max = value;
      if (value < Number(slider.min)) slider.min = value;
      slider.value = value;
    } else return;
    spoken(slider, text.value);
  }
  addEventListener("input", follow, true);
  addEventListener("change", follow, true);

  new MutationObserver((changes) => {
    for (const change of changes) if (change.type === "attributes") place(change.target);
    for (const input of document.querySelectorAll(".control input:not([data-placed])")) place(input);
    for (const element of document.querySelectorAll(".strip-data:not([data-begun])")) begin(element);
  }).observe(document.documentElement, { childList: true, subtree: true, attributes: true, attributeFilter: ["data-round"] });

  // A link to a limit opens the list that it is in.
  addEventListener("click", (event) => {
    const link = event.target.closest?.('a[href^="#limit-"]');
    if (!link) return;
    event.preventDefault();
    const target = document.getElementById(link.getAttribute("href").slice(1));
    const list = target?.closest("details");
    if (list) list.open = true;
    target?.scrollIntoView({ block: "center" });
    target?.focus();
  });
})();
