// Decides exactly, in whole numbers, whether a plan works with given values.
//
// Input: the inequalities of the answer of `envelope` (docs/reference/formats/envelope-json.md), and a value for each
// parameter, as a text: `10`, `0.25`, `1393/2`. The plan works if its network has a schedule and no schedule
// violates a requirement.

// Fractions: [numerator, denominator], in lowest terms, the denominator positive.
const gcd = (a, b) => { while (b) [a, b] = [b, a % b]; return a < 0n ? -a : a; };
function fraction(numerator, denominator = 1n) {
  const divisor = gcd(numerator, denominator) * (denominator < 0n ? -1n : 1n);
  return divisor === 0n ? [0n, 1n] : [numerator / divisor, denominator / divisor];
}
function parsed(text) {
  const [numerator, denominator = "1"] = text.split("/");
  const [whole, decimals = ""] = numerator.split(".");
  return fraction(BigInt(whole + decimals), 10n ** BigInt(decimals.length) * BigInt(denominator));
}
const ZERO = [0n, 1n], ONE = [1n, 1n];
const plus = (a, b) => fraction(a[0] * b[1] + b[0] * a[1], a[1] * b[1]);
const times = (a, b) => fraction(a[0] * b[0], a[1] * b[1]);
const negated = (a) => [-a[0], a[1]];
const minus = (a, b) => plus(a, negated(b));
const over = (a, b) => fraction(a[0] * b[1], a[1] * b[0]);
const sign = (a) => (a[0] > 0n ? 1 : a[0] < 0n ? -1 : 0);
const toNumber = ([a, b]) => {
  const whole = a / b;
  return Number(whole) + Number(a - whole * b) / Number(b);
};

// `t3 + -1/2*p0*t1 + 5 < 0` as terms.
function readRow(text) {
  const [left, isStrict] = text.endsWith(" <= 0") ? [text.slice(0, -5), false] : [text.slice(0, -4), true];
  const terms = left.split(" + ").map((term) => {
    const read = { by: ONE, time: null, parameters: [] };
    for (const factor of term.split("*")) {
      if (factor[0] === "t") read.time = Number(factor.slice(1));
      else if (factor[0] === "p") read.parameters.push(Number(factor.slice(1)));
      else read.by = times(read.by, parsed(factor));
    }
    return read;
  });
  return { terms, isStrict };
}

// The row after substitution of the values: coefficients of times, and a constant.
function valued({ terms, isStrict }, values) {
  const by = new Map();
  let constant = ZERO;
  for (const term of terms) {
    const value = term.parameters.reduce((product, index) => times(product, values[index]), term.by);
    if (term.time === null) constant = plus(constant, value);
    else by.set(term.time, plus(by.get(term.time) ?? ZERO, value));
  }
  for (const [time, value] of by) if (sign(value) === 0) by.delete(time);
  return { by, constant, isStrict };
}

// The row as `to - from <= bound`, if it has this form; time 0 is zero.
function asDifference({ by, constant, isStrict }) {
  if (by.size > 2) return null;
  let [from, to] = [0, 0];
  for (const [time, [a, b]] of by) {
    if (b !== 1n || a !== 1n && a !== -1n) return null;
    if (a === 1n && to === 0) to = time;
    else if (a === -1n && from === 0) from = time;
    else return null;
  }
  return { from, to, bound: negated(constant), isStrict };
}

// Shortest paths between all pairs, in place: [i][j] is the greatest value of t_j - t_i.
function tighten(matrix, zero) {
  const count = matrix.length;
  for (let k = 0; k < count; k++) {
    const through = matrix[k];
    for (let i = 0; i < count; i++) {
      const first = matrix[i][k], row = matrix[i];
      if (first === null) continue;
      for (let j = 0; j < count; j++) {
        const second = through[j];
        if (second === null) continue;
        const sum = first + second;
        if (row[j] === null || sum < row[j]) row[j] = sum;
      }
    }
    for (let i = 0; i < count; i++) if (matrix[i][i] < zero) return false;
  }
  return true;
}

// The system with parsed rows, shared by all values.
function readSystem({ times: labels, network, requirements }) {
  return {
    count: labels.length,
    network: network.map((it) => ({ ...it, read: readRow(it.row) })),
    requirements: requirements.map((it) => ({ ...it, cases: it.broken_if.map((rows) => rows.map(readRow)) })),
  };
}

// Result for these values:
//   { works: true, earliest, latest }   times as numbers for drawing; `latest` is null if it is unbounded
//   { works: false, words }             with the reason in words
//   { works: null, words }              undecided, because happenings may come in another order
function checkPoint(system, values) {
  const network = system.network.map((it) => valued(it.read, values));
  const cases = system.requirements.map((it) => it.cases.map((rows) => rows.map((row) => valued(row, values))));

  // Bounds as whole numbers: `scale` times the bound, minus one if the bound itself is excluded. The scale is so large
  // that the subtracted ones of a path add up to less than the least difference between two bounds.
  const differences = [...network, ...cases.flat(2)].map(asDifference).filter(Boolean);
  const common = differences.reduce((least, { bound: [, b] }) => (least / gcd(least, b)) * b, 1n);
  const strictness = BigInt(system.count + 4);
  const exact = ({ bound: [a, b], isStrict }) => a * (common / b) * strictness - (isStrict ? 1n : 0n);
  const largest = differences.map(exact).reduce((most, it) => { const size = it < 0n ? -it : it; return size > most ? size : most; }, 1n);
  // Doubles are exact while sums of paths stay below 2^53.
  const isSmall = largest * (strictness + 4n) * 4n < BigInt(Number.MAX_SAFE_INTEGER);
  const whole = isSmall ? Number : (it) => it;
  const zero = whole(0n);
  const weight = (difference) => whole(exact(difference));
  // Converts back: the bound, and `true` if it is excluded.
  const bound = (it) => {
    const value = BigInt(it);
    let up = value / strictness;
    if (value > 0n && value % strictness !== 0n) up += 1n;
    return { value: fraction(up, common), isStrict: up * strictness !== value };
  };
  const square = (count) => Array.from({ length: count }, (_, i) => Array.from({ length: count }, (_, j) => (i === j ? zero : null)));
  const add = (matrix, from, to, limit) => { if (matrix[from][to] === null || limit < matrix[from][to]) matrix[from][to] = limit; };

  const edges = [];
  for (const [index, row] of network.entries()) {
    const difference = asDifference(row);
    edges.push({ from: difference.from, to: difference.to, weight: weight(difference), ...system.network[index] });
  }
  const all = square(system.count);
  for (const { from, to, weight } of edges) add(all, from, to, weight);
  if (!tighten(all, zero)) return { works: false, words: conflict(system.count, edges, zero) };

  let broken = null;
  for (const [index, requirement] of system.requirements.entries()) {
    if (broken && !requirement.is_order) continue;
    if (!cases[index].some(isPossible)) continue;
    if (requirement.is_order) return { works: null, words: requirement.words };
    broken = { works: false, words: requirement.words };
  }
  if (broken) return broken;
  return {
    works: true,
    earliest: all.map((row) => (row[0] === null ? 0 : -toNumber(bound(row[0]).value))),
    latest: all[0].map((it) => (it === null ? null : toNumber(bound(it).value))),
  };

  // Returns true if all rows hold at once in some schedule. Only the times in the rows matter; the network restricts them
  // by the greatest difference of each pair.
  function isPossible(rows) {
    const others = [], assumed = [];
    for (const row of rows) {
      if (row.by.size === 0) {
        if (sign(row.constant) > 0 || row.isStrict && sign(row.constant) === 0) return false;
        continue;
      }
      const difference = asDifference(row);
      if (difference) assumed.push(difference);
      else others.push(row);
    }
    const places = new Map([[0, 0]]);
    for (const { by } of rows) for (const time of by.keys()) if (!places.has(time)) places.set(time, places.size);
    const part = square(places.size);
    for (const [a, i] of places) for (const [b, j] of places) {
      if (i !== j && a < system.count && b < system.count && all[a][b] !== null) part[i][j] = all[a][b];
    }
    for (const difference of assumed) add(part, places.get(difference.from), places.get(difference.to), weight(difference));
    if (!tighten(part, zero)) return false;
    return others.length === 0 || hasSolution(part.map((row) => row.map((it) => (it === null ? null : bound(it)))), others, places);
  }
}

// Returns true if some differences within `bounds` (for each pair of places) also satisfy the rows.
function hasSolution(bounds, rows, places) {
  // Places at a fixed distance share one variable; the first place, time zero, has no variable.
  const leader = bounds.map((_, i) => i), offset = bounds.map(() => ZERO);
  for (let i = 0; i < bounds.length; i++) {
    for (let first = 0; first < i; first++) {
      const [there, back] = [bounds[first][i], bounds[i][first]];
      if (leader[first] !== first || !there || !back || there.isStrict || back.isStrict) continue;
      if (sign(plus(there.value, back.value)) !== 0) continue;
      [leader[i], offset[i]] = [first, there.value];
      break;
    }
  }
  const columns = new Map();
  for (const own of leader) if (own !== 0 && !columns.has(own)) columns.set(own, columns.size);
  const count = columns.size;
  // Each constraint has coefficients and an upper bound. The last coefficient is that of the margin of strict
  // constraints, which is maximized.
  const constraints = [];
  const constraint = (terms, most, isStrict) => {
    const line = Array(count + 1).fill(ZERO);
    for (const [place, by] of terms) {
      most = minus(most, times(by, offset[place]));
      if (leader[place] !== 0) line[columns.get(leader[place])] = plus(line[columns.get(leader[place])], by);
    }
    if (isStrict) line[count] = ONE;
    constraints.push({ line, most });
  };
  for (const [i, row] of bounds.entries()) for (const [j, limit] of row.entries()) {
    if (i !== j && limit && leader[i] === i && leader[j] === j) constraint([[j, ONE], [i, negated(ONE)]], limit.value, limit.isStrict);
  }
  for (const { by, constant, isStrict } of rows) {
    constraint([...by].map(([time, value]) => [places.get(time), value]), negated(constant), isStrict);
  }
  const isStrict = constraints.some(({ line }) => sign(line[count]) !== 0);
  constraint([], ONE, true);
  const margin = greatestLast(constraints, count + 1);
  return margin !== null && (!isStrict || sign(margin) > 0);
}

// Returns the greatest value of the last of `count` nonnegative variables under constraints; null if these
// contradict each other. Simplex method with Bland's rule, which always terminates.
function greatestLast(constraints, count) {
  // Columns: the variables, the artificial variable, the right side.
  const helper = count, right = count + 1;
  const rows = constraints.map(({ line, most }) => [...line, negated(ONE), most]);
  const basic = rows.map((_, index) => count + 1 + index), free = Array.from({ length: count + 1 }, (_, index) => index);
  const goal = Array(count + 2).fill(ZERO);
  goal[helper] = negated(ONE);
  const goals = [goal, Array(count + 2).fill(ZERO)];
  goals[1][count - 1] = ONE;

  const pivot = (row, column) => {
    const by = rows[row][column];
    const line = rows[row].map((it, index) => over(index === column ? ONE : it, by));
    for (const other of [...rows, ...goals]) {
      if (other === rows[row] || sign(other[column]) === 0) continue;
      const factor = other[column];
      for (let index = 0; index <= right; index++) {
        const change = times(factor, line[index]);
        other[index] = index === column ? negated(change) : minus(other[index], change);
      }
    }
    rows[row] = line;
    [basic[row], free[column]] = [free[column], basic[row]];
  };
  const climb = (goal, barred) => {
    for (;;) {
      let column = -1;
      for (let index = 0; index < right; index++) {
        if (index !== barred && sign(goal[index]) > 0 && (column === -1 || free[index] < free[column])) column = index;
      }
      if (column === -1) return;
      let row = -1, least = null;
      for (let index = 0; index < rows.length; index++) {
        if (sign(rows[index][column]) <= 0) continue;
        const ratio = over(rows[index][right], rows[index][column]);
        const order = least === null ? -1 : sign(minus(ratio, least));
        if (order < 0 || order === 0 && basic[index] < basic[row]) [row, least] = [index, ratio];
      }
      if (row === -1) throw new Error("unbounded");
      pivot(row, column);
    }
  };

  let worst = 0;
  for (let index = 1; index < rows.length; index++) if (sign(minus(rows[index][right], rows[worst][right])) < 0) worst = index;
  if (sign(rows[worst][right]) < 0) {
    pivot(worst, helper);
    climb(goals[0], -1);
    const row = basic.indexOf(helper);
    if (row !== -1) {
      if (sign(rows[row][right]) !== 0) return null;
      const column = free.findIndex((_, index) => sign(rows[row][index]) !== 0);
      if (column !== -1) pivot(row, column);
    }
  }
  climb(goals[1], free.indexOf(helper));
  return negated(goals[1][right]);
}

// Describes the conflict: the bounds of a cycle with a negative sum.
function conflict(count, edges, zero) {
  const least = Array(count).fill(zero), from = Array(count).fill(null);
  let last = null;
  for (let round = 0; round <= count; round++) {
    last = null;
    for (const edge of edges) {
      const value = least[edge.from] + edge.weight;
      if (value < least[edge.to]) { least[edge.to] = value; from[edge.to] = edge; last = edge.to; }
    }
    if (last === null) break;
  }
  for (let step = 0; step < count; step++) last = from[last].from;
  const cycle = [];
  let node = last;
  do { cycle.unshift(from[node]); node = from[node].from; } while (node !== last);
  const said = (isNeed) => [...new Set(cycle.filter((edge) => edge.is_need === isNeed && edge.words).map((edge) => edge.words))];
  const needs = said(true), rooms = said(false);
  if (!needs.length) return rooms.length ? `${rooms.join(" and ")} cannot be kept` : "happenings of the plan would have to precede themselves";
  return `${needs.reverse().join(", ")} ${needs.length === 1 ? "does" : "do"} not fit: ${rooms.join(" and ") || "not enough time"}`;
}
