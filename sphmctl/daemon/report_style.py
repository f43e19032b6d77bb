"""The style sheet of a run's report: light and dark, narrow and wide, screen and paper."""

from __future__ import annotations

STYLE = """
:root {
  color-scheme: light dark;
  --page: #f4f5f7; --card: #ffffff; --ink: #1b1f24; --soft: #5b6470; --rule: #dfe3e8;
  --required: #a9c9f5; --measured: #b4430b; --second: #2b66c0; --third: #1a7f5a;
  --good: #1a7f4b; --bad: #b3261e;
  --warn-page: #fff3d6; --warn-ink: #6b4a00; --level: #b3261e;
}
@media (prefers-color-scheme: dark) {
  :root {
    --page: #12151a; --card: #1b2027; --ink: #e8ebef; --soft: #9aa5b1; --rule: #313842;
    --required: #2f5c9c; --measured: #ffb46b; --second: #7db2ff; --third: #63d2a3;
    --good: #5fd08f; --bad: #ff8a80;
    --warn-page: #40330f; --warn-ink: #ffdf91; --level: #ff8a80;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--page); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif;
  font-variant-numeric: tabular-nums;
}
main { max-width: 1180px; margin: 0 auto; padding: 24px 20px 48px; }
header { display: flex; flex-wrap: wrap; align-items: baseline; gap: 4px 14px; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 34px 0 10px; }
h3 { font-size: .95rem; margin: 0 0 2px; font-weight: 600; }
.aside { font-weight: 400; font-size: .82rem; color: var(--soft); float: right; }
p { margin: 6px 0; max-width: 75ch; }
.soft, .when { color: var(--soft); }
.verdict { font-size: 1.1rem; }
.badge {
  font-weight: 600; padding: 1px 12px; border-radius: 99px; border: 1.5px solid currentColor;
}
.good { color: var(--good); } .bad { color: var(--bad); }
.banner {
  background: var(--warn-page); color: var(--warn-ink); font-weight: 600;
  padding: 8px 14px; border-radius: 8px; margin: 0 0 18px; max-width: none;
}
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(235px, 1fr)); gap: 12px; }
.panels { display: grid; grid-template-columns: repeat(auto-fill, minmax(300px, 1fr)); gap: 12px; }
.pair {
  display: grid; grid-template-columns: repeat(auto-fill, minmax(min(460px, 100%), 1fr)); gap: 12px;
}
.below { margin-top: 12px; }
.card {
  background: var(--card); border: 1px solid var(--rule); border-radius: 10px;
  padding: 12px 14px; min-width: 0;
}
.figures .card { display: flex; flex-direction: column; }
.figures .name { color: var(--soft); font-size: .85rem; }
.figures .value { font-size: 1.6rem; font-weight: 650; line-height: 1.25; }
.figures .limit { font-size: .8rem; color: var(--soft); }
.legend { display: flex; flex-wrap: wrap; gap: 4px 20px; font-size: .9rem; margin: 0 0 8px; }
.legend span::before {
  content: ""; display: inline-block; width: 26px; margin-right: 7px; vertical-align: middle;
  border-top: 2px solid var(--measured);
}
.legend .required::before { border-top: 6px solid var(--required); }
.legend .third::before { border-color: var(--third); }
.legend .second::before { border-color: var(--second); }
.legend .level::before { border-top: 1.5px dashed var(--level); }
.chart { display: block; width: 100%; height: auto; }
.chart text { fill: var(--soft); font-size: 11px; font-family: inherit; }
.chart .end { text-anchor: end; } .chart .middle { text-anchor: middle; }
.chart .mark { fill: var(--ink); font-size: 13px; font-weight: 600; }
.chart .grid { stroke: var(--rule); stroke-width: 1; }
.chart .axis { stroke: var(--soft); stroke-width: 1; }
.chart .level { stroke: var(--level); stroke-width: 1.2; stroke-dasharray: 5 4; }
.chart .line { fill: none; stroke-linejoin: round; stroke-linecap: round; stroke-width: 1.4; }
.chart .required { stroke: var(--required); stroke-width: 6; }
.chart .measured { stroke: var(--measured); }
.chart .second { stroke: var(--second); } .chart .third { stroke: var(--third); }
.chart .dot { fill: var(--ink); }
.scroll { overflow-x: auto; padding: 4px 6px; }
table { border-collapse: collapse; width: 100%; font-size: .86rem; }
th, td { padding: 5px 8px; text-align: right; white-space: nowrap; }
thead th { color: var(--soft); font-weight: 600; }
thead tr:first-child th { text-align: center; color: var(--ink); }
tbody tr { border-top: 1px solid var(--rule); }
th:first-child, td.text { text-align: left; }
.events td { white-space: normal; } .events td:last-child { width: 100%; }
.first { border-left: 1px solid var(--rule); }
ul { margin: 6px 0; padding-left: 1.2em; } li { margin: 3px 0; overflow-wrap: anywhere; }
a { color: inherit; }
footer { margin-top: 34px; color: var(--soft); font-size: .85rem; }
@media (max-width: 520px) {
  main { padding: 16px 12px 32px; } h1 { font-size: 1.5rem; }
  .figures { grid-template-columns: 1fr 1fr; } .figures .value { font-size: 1.35rem; }
}
@media print {
  :root {
    --page: #ffffff; --card: #ffffff; --ink: #000000; --soft: #444444; --rule: #cccccc;
    --required: #a9c9f5; --measured: #a63c08; --second: #2b66c0; --third: #14684a;
    --good: #14683c; --bad: #9c1f18;
    --warn-page: #ffffff; --warn-ink: #000000; --level: #9c1f18;
  }
  body { font-size: 9.5pt; } .figures { grid-template-columns: repeat(4, 1fr); }
  main { max-width: none; padding: 0; }
  .banner { border: 2px solid #000000; }
  .card, tr { break-inside: avoid; } h2 { break-after: avoid; }
  .panels { grid-template-columns: repeat(3, 1fr); } .pair { grid-template-columns: 1fr 1fr; }
  .scroll { overflow: visible; } table { font-size: 7.5pt; } th, td { padding: 2px 4px; }
}
"""
