// Draws what a browser's window shows as an SVG: boxes, borders, text where the browser has put it,
// the page's own drawings. Fields are drawn as plain ones. Evaluated in the page; gives the text.
() => {
  const out = [];
  const width = window.innerWidth;
  const height = window.innerHeight;
  const style = (element) => getComputedStyle(element);
  const round = (value) => String(Math.round(value * 10) / 10);
  const escaped = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/"/g, "&quot;");
  const attributes = (values) => Object.entries(values).filter(([, value]) => value !== undefined && value !== "")
    .map(([name, value]) => ` ${name}="${typeof value === "number" ? round(value) : escaped(value)}"`).join("");
  const draw = (tag, values) => out.push(`<${tag}${attributes(values)}/>`);

  /** A colour as the SVG has it; undefined for none. */
  function colour(text) {
    const [r, g, b, a = 1] = text.match(/[\d.]+/g)?.map(Number) ?? [];
    if (r === undefined || a === 0) return undefined;
    const hex = [r, g, b].map((part) => Math.round(part).toString(16).padStart(2, "0")).join("");
    return a === 1 ? `#${hex}` : `#${hex}${Math.round(a * 255).toString(16).padStart(2, "0")}`;
  }

  function outside({ left, top, right, bottom }) {
    return right <= 0 || bottom <= 0 || left >= width || top >= height || right - left < 0.5 || bottom - top < 0.5;
  }

  function box(element, place) {
    const found = style(element);
    const radius = Math.min(parseFloat(found.borderTopLeftRadius) || 0, place.height / 2);
    const sides = ["Top", "Right", "Bottom", "Left"].map((side) => ({
      width: parseFloat(found[`border${side}Width`]),
      colour: colour(found[`border${side}Color`]),
    }));
    const whole = sides.every((side) => side.width === sides[0].width && side.colour === sides[0].colour);
    const border = whole && sides[0].width > 0 ? sides[0] : null;
    const inset = border ? border.width / 2 : 0;
    const fill = colour(found.backgroundColor);
    if (fill || border) {
      draw("rect", {
        x: place.left + inset, y: place.top + inset, width: place.width - 2 * inset, height: place.height - 2 * inset,
        rx: radius || undefined, fill: fill ?? "none", stroke: border?.colour, "stroke-width": border?.width,
      });
    }
    if (!whole) {
      const { left, right, top, bottom } = place;
      const lines = [[left, top, right, top], [right, top, right, bottom], [left, bottom, right, bottom], [left, top, left, bottom]];
      sides.forEach((side, i) => {
        if (!side.width || !side.colour) return;
        const [x1, y1, x2, y2] = lines[i];
        draw("line", { x1, y1, x2, y2, stroke: side.colour, "stroke-width": side.width });
      });
    }
    if (found.outlineStyle === "solid") {
      const far = parseFloat(found.outlineWidth) / 2;
      draw("rect", { x: place.left - far, y: place.top - far, width: place.width + 2 * far, height: place.height + 2 * far, rx: radius + far, fill: "none", stroke: colour(found.outlineColor), "stroke-width": 2 * far });
    }
  }

  /** One line of text; its length is given, as another computer has other letters. */
  function line(text, found, left, middle, length) {
    const size = parseFloat(found.fontSize);
    const said = text.replace(/\s+/g, " ").trim();
    if (!said) return;
    out.push(`<text${attributes({
      x: left, y: middle + size * 0.35, fill: colour(found.color), "font-size": size,
      "font-weight": Number(found.fontWeight) >= 600 ? "bold" : undefined,
      class: found.fontFamily.includes("monospace") ? "m" : undefined,
      textLength: said.length > 1 && length ? length : undefined, lengthAdjust: said.length > 1 && length ? "spacingAndGlyphs" : undefined,
    })}>${escaped(said)}</text>`);
  }

  /** The lines of a piece of text, as the browser has broken it. */
  function lines(node) {
    const found = style(node.parentElement);
    const range = document.createRange();
    let now = null;
    const done = () => now && !outside(now) && line(now.text, found, now.left, (now.top + now.bottom) / 2, now.right - now.left);
    for (let at = 0; at < node.data.length; at += 1) {
      range.setStart(node, at);
      range.setEnd(node, at + 1);
      const place = range.getClientRects()[0];
      const sign = node.data[at];
      if (!place || !place.width) continue;
      if (now && Math.abs(place.top - now.top) < 2) {
        now.text += sign;
        if (sign.trim()) now.right = place.right;
      } else if (sign.trim()) {
        done();
        now = { text: sign, left: place.left, right: place.right, top: place.top, bottom: place.bottom };
      }
    }
    done();
  }

  function field(element, place) {
    const found = style(element);
    const middle = (place.top + place.bottom) / 2;
    const main = colour(found.accentColor) ?? colour(style(document.querySelector("nav button[aria-current]")).borderBottomColor);
    if (element.type === "checkbox") {
      draw("rect", { x: place.left + 1, y: place.top + 1, width: place.width - 2, height: place.height - 2, rx: 3, fill: element.checked ? main : "none", stroke: element.checked ? main : colour(found.color), "stroke-width": 1 });
      if (element.checked) draw("path", { d: `M${round(place.left + 4)} ${round(middle)}l4 4l7 -8`, fill: "none", stroke: "#fff", "stroke-width": 2 });
    } else if (element.type === "range" || element.tagName === "PROGRESS") {
      const share = (Number(element.value) - Number(element.min || 0)) / (Number(element.max) - Number(element.min || 0));
      const x = place.left + 8 + share * (place.width - 16);
      draw("rect", { x: place.left, y: middle - 3, width: place.width, height: 6, rx: 3, fill: colour(found.color), "fill-opacity": "0.25" });
      draw("rect", { x: place.left, y: middle - 3, width: x - place.left, height: 6, rx: 3, fill: main });
      if (element.type === "range") draw("circle", { cx: x, cy: middle, r: 8, fill: main });
    } else if (element.tagName === "TEXTAREA") {
      const size = parseFloat(found.lineHeight);
      element.value.split("\n").forEach((text, i) => {
        const y = place.top + 6 + (i + 0.5) * size - element.scrollTop;
        if (y < place.bottom - 4 && y > place.top) line(text.replaceAll(" ", "\u00a0"), found, place.left + 8, y);
      });
    } else {
      const chosen = element.tagName === "SELECT" ? `${element.selectedOptions[0]?.textContent ?? ""} ▾` : element.value;
      const text = element.type === "file" ? element.files[0]?.name ?? "No file chosen" : chosen;
      line(text, found, place.left + 9, middle);
    }
  }

  /** One of the page's own drawings, with its colours as they come out. */
  function drawing(element, place) {
    const copy = element.cloneNode(true);
    const originals = [element, ...element.querySelectorAll("*")];
    [copy, ...copy.querySelectorAll("*")].forEach((each, i) => {
      const found = style(originals[i]);
      each.removeAttribute("class");
      each.removeAttribute("aria-label");
      each.removeAttribute("aria-hidden");
      each.removeAttribute("role");
      if (each.getAttribute("stroke") === "currentColor") each.setAttribute("stroke", colour(found.color));
      if (each.tagName === "text") {
        each.setAttribute("fill", colour(found.fill));
        each.setAttribute("font-size", round(parseFloat(found.fontSize)));
      }
    });
    copy.setAttribute("x", round(place.left));
    copy.setAttribute("y", round(place.top));
    copy.setAttribute("width", round(place.width));
    copy.setAttribute("height", round(place.height));
    out.push(copy.outerHTML.replace(/ xmlns="[^"]*"/, "").replace(/(\.\d)\d+/g, "$1"));
  }

  function visit(element) {
    const found = style(element);
    if (!element.checkVisibility({ visibilityProperty: true })) return; // so is what a closed detail has
    const place = element.getBoundingClientRect();
    if (outside(place) && found.position !== "sticky") return;
    const faint = Number(found.opacity) < 1;
    if (faint) out.push(`<g opacity="${found.opacity}">`);
    if (element.type !== "range" && element.type !== "checkbox") box(element, place);
    if (/^(INPUT|SELECT|TEXTAREA|PROGRESS)$/.test(element.tagName)) field(element, place);
    else if (element.tagName === "svg") drawing(element, place);
    else {
      const clips = found.overflowX !== "visible" || found.overflowY !== "visible";
      if (clips) out.push(`<svg${attributes({ x: place.left, y: place.top, width: place.width, height: place.height, viewBox: [place.left, place.top, place.width, place.height].map(round).join(" ") })}>`);
      for (const child of element.childNodes) {
        if (child.nodeType === Node.TEXT_NODE) lines(child);
        else if (child.nodeType === Node.ELEMENT_NODE) visit(child);
      }
      if (clips) out.push("</svg>");
    }
    if (element.tagName === "SUMMARY") line(element.parentElement.open ? "▾" : "▸", found, place.left, (place.top + place.bottom) / 2);
    if (faint) out.push("</g>");
  }

  // What a view consists of, for a test that the picture is not of an older one
  const parts = [...document.querySelectorAll("h1, h2, h3, button, label, legend, summary, th")]
    .filter((element) => element.checkVisibility() && !element.closest("header"))
    .map((element) => element.getAttribute("aria-label") ?? element.textContent.replace(/\s+/g, " ").trim());
  draw("rect", { width, height, fill: colour(style(document.body).backgroundColor) });
  for (const child of document.body.children) visit(child);
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${width} ${height}" width="${width}" height="${height}" font-family="system-ui, sans-serif">\n`
    + `<desc>${escaped(parts.join("; "))}</desc>\n`
    + `<style>.m{font-family:ui-monospace,monospace}</style>\n${out.join("\n")}\n</svg>\n`;
}
