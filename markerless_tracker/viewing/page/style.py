"""The page's style sheet."""

STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --dim: #5b6470; --paper: #ffffff; --card: #f5f6f8;
  --rule: #d5d9df; --left: #0089a3; --right: #a87900; --s0: #2563c9; --s1: #c2410c; --s2: #15803d;
  --s3: #9333ea; --s4: #be185d; --s5: #57534e; --s6: #0e7490; --s7: #854d0e; --doubt: #a12b0e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8eaed; --dim: #a2abb7; --paper: #14171b;
  --card: #1e2228; --rule: #3a414b; --left: #22d3ee; --right: #facc15; --s0: #7aa7ff; --s1: #fb923c;
  --s2: #4ade80; --s3: #c084fc; --s4: #f472b6; --s5: #d6d3d1; --s6: #67e8f9; --s7: #fcd34d;
  --doubt: #ff9b7a; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, sans-serif; }
main, header, footer { max-width: 90rem; margin: 0 auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; line-height: 1.25; margin: 1.2rem 0 .3rem; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 1.8rem 0 .4rem; overflow-wrap: anywhere; }
h3 { font-size: 1rem; margin: 1.4rem 0 .4rem; }
p { margin: .4rem 0; max-width: 70ch; }
.dim, footer { color: var(--dim); font-size: .875rem; }
.verdict { font-size: 1.1rem; }
.doubts { color: var(--doubt); max-width: 70ch; padding-left: 1.2rem; }
.results, .top, .charts { display: grid; gap: 0 2rem;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 30rem), 1fr)); }
.top { align-items: start; }
@media (min-width: 64rem) { .top { grid-template-columns: minmax(0, 2fr) minmax(0, 1fr); } }
.results > *, .top > * { min-width: 0; }
video, .still { display: block; width: 100%; height: auto; border-radius: 6px; background: #000; }
.still { display: none; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .875rem; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .7rem .2rem 0; text-align: right; border-bottom: 1px solid var(--rule);
  white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
.words td:last-child { white-space: normal; overflow-wrap: anywhere; }
th { color: var(--dim); font-weight: 600; }
.charts { grid-template-columns: repeat(auto-fill, minmax(min(100%, 20rem), 1fr)); }
.chart { margin: 0 0 1rem; min-width: 0; break-inside: avoid; }
figcaption { font-size: .875rem; font-weight: 600; }
.unit, .legend { color: var(--dim); font-weight: 400; }
.legend { display: flex; flex-wrap: wrap; gap: 0 .9rem; list-style: none; margin: 0; padding: 0;
  font-size: .8125rem; }
.key { display: inline-block; width: 1.1rem; height: 0; margin-right: .35rem;
  vertical-align: middle; border-top: 3px solid var(--c); }
.key.dashed { border-top-style: dotted; }
.plot { position: relative; height: 11rem; margin: .5rem .9rem 1.6rem 2.9rem;
  border-bottom: 1px solid var(--rule); }
.plot svg { display: block; width: 100%; height: 100%; overflow: visible; }
.plot span { position: absolute; font-size: .75rem; line-height: 1; color: var(--dim); }
.yt { right: calc(100% + .4rem); transform: translateY(-50%); }
.xt { top: calc(100% + .35rem); transform: translateX(-50%); }
.xu { top: calc(100% - .35rem); left: calc(100% + .25rem); }
.lt { right: 0; transform: translateY(-115%); background: var(--paper); padding: 1px 3px;
  opacity: .85; max-width: 100%; }
.levels { display: none; }
.levels .key { border-top: 2px dashed var(--dim); }
@media (max-width: 40rem) { .lt { display: none; } .levels { display: flex; } }
path { fill: none; vector-effect: non-scaling-stroke; stroke: var(--c); }
.grid { stroke: var(--rule); stroke-width: 1; }
.level { stroke: var(--dim); stroke-width: 1.5; stroke-dasharray: 6 4; }
.line { stroke-width: 1.8; stroke-linejoin: round; }
.mark { stroke-width: 1.2; stroke-dasharray: 2 4; }
.left { --c: var(--left); } .right { --c: var(--right); }
.s0 { --c: var(--s0); } .s1 { --c: var(--s1); } .s2 { --c: var(--s2); } .s3 { --c: var(--s3); }
.s4 { --c: var(--s4); } .s5 { --c: var(--s5); } .s6 { --c: var(--s6); } .s7 { --c: var(--s7); }
summary { cursor: pointer; font-weight: 600; margin: .8rem 0 .4rem; }
@media print { :root { color-scheme: light; --ink: #000; --dim: #444; --paper: #fff; --card: #fff;
  --rule: #bbb; --left: #0089a3; --right: #a87900; --s0: #2563c9; --s1: #c2410c; --s2: #15803d;
  --s3: #9333ea; --s4: #be185d; --s5: #57534e; --s6: #0e7490; --s7: #854d0e; --doubt: #a12b0e; }
  body { font-size: 10pt; } video { display: none; }
  .still { display: block; width: auto; max-width: 100%; max-height: 14cm; }
  h2, h3 { break-after: avoid; } tr, .chart { break-inside: avoid; } .wide { overflow: visible; }
  .plot { height: 8rem; } }
"""
"""CSS of the page: light and dark by the reader's choice, phone and desktop, paper."""
