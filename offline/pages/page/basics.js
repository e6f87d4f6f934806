// What the scripts of all pages use: elements, times of samples, and numbers as text.

function element(tag, attributes, parent, text) {
  const svg = ['svg', 'g', 'path', 'line', 'circle', 'rect', 'text', 'title', 'defs', 'clipPath', 'polyline'].includes(tag);
  const node = svg ? document.createElementNS('http://www.w3.org/2000/svg', tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) node.setAttribute(name, value);
  if (text !== undefined) node.textContent = text;
  if (parent) parent.appendChild(node);
  return node;
}

// When samples were taken. Columns of the data are arrays over them.
class Times {
  constructor(times) {
    this.times = times;
    this.first = times[0];
    this.last = times[times.length - 1];
  }

  clamp(t) {
    return Math.min(Math.max(t, this.first), this.last);
  }

  // The sample at or before t, and how far t is on the way to the next one, in [0, 1].
  locate(t) {
    let low = 0;
    let high = this.times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.times[middle] <= t) low = middle;
      else high = middle;
    }
    const share = (t - this.times[low]) / (this.times[high] - this.times[low]);
    return [low, Math.min(Math.max(share, 0), 1)];
  }

  nearest(t) {
    const [i, share] = this.locate(t);
    return share < 0.5 ? i : i + 1;
  }

  // None where a column has none.
  value(column, t) {
    const [i, share] = this.locate(t);
    if (column[i] === null || column[i + 1] === null) return null;
    return column[i] + share * (column[i + 1] - column[i]);
  }
}

// Numbers as text: a true minus sign, and always the same width for the same digits.

function fixed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace('-', '') : text.replace('-', '−');
}

// The same of what may not be there.
const shown = (value, digits) => (Number.isFinite(value) ? fixed(value, digits) : '–');

function superscript(integer) {
  return String(integer).replace(/[-0-9]/g, (c) => (c === '-' ? '⁻' : '⁰¹²³⁴⁵⁶⁷⁸⁹'[c]));
}

// Four significant digits, in powers of ten where plain digits would be long.
function significant(value) {
  if (value === 0) return '0';
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  if (exponent >= -3 && exponent < 5) return fixed(value, Math.max(0, 3 - exponent));
  return `${fixed(value / 10 ** exponent, 2)}×10${superscript(exponent)}`;
}
