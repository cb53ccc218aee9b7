# SPDX-License-Identifier: Apache-2.0
"""Style sheet of the reports, in a light and a dark scheme."""

STYLESHEET = """
:root {
  color-scheme: light dark;
  --page: #f6f7f9; --card: #ffffff; --ink: #1d2733; --soft: #5a6777; --line: #dde3ea;
  --accent: #0b5fa5; --good: #17724a; --bad: #b3351b; --mark: #fdeeea; --stripe: #f8fafc;
}
@media (prefers-color-scheme: dark) {
  :root {
    --page: #12171e; --card: #1a212b; --ink: #e4e9ef; --soft: #9aa7b6; --line: #303b48;
    --accent: #6cb4f2; --good: #59c795; --bad: #f08a72; --mark: #3a221d; --stripe: #1e2631;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--page); color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", "DejaVu Sans",
    sans-serif;
}
main { max-width: 1120px; margin: 0 auto; padding: 40px 24px 56px; }
header { margin-bottom: 28px; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 6px; letter-spacing: -0.01em; }
header p { margin: 0; color: var(--soft); max-width: 75ch; }
section {
  background: var(--card); border: 1px solid var(--line); border-radius: 10px;
  padding: 22px 26px 24px; margin: 0 0 20px;
}
h2 { font-size: 1.15rem; margin: 0 0 12px; }
section > p { margin: 0 0 12px; max-width: 80ch; }
section > p:last-child { margin-bottom: 0; }
.small { color: var(--soft); font-size: 0.87rem; }
.numbers { display: grid; grid-template-columns: repeat(auto-fit, minmax(225px, 1fr)); gap: 14px; }
.numbers + * { margin-top: 16px; }
.number {
  border: 1px solid var(--line); border-left: 4px solid var(--accent); border-radius: 8px;
  padding: 12px 14px;
}
.number.good { border-left-color: var(--good); }
.number.bad { border-left-color: var(--bad); }
.label { color: var(--soft); font-size: 0.85rem; line-height: 1.3; }
.ours {
  font-size: 1.4rem; font-weight: 650; line-height: 1.4; font-variant-numeric: tabular-nums;
  white-space: nowrap;
}
.number.good .ours { color: var(--good); }
.number.bad .ours { color: var(--bad); }
.paper { font-size: 0.92rem; font-variant-numeric: tabular-nums; }
.note { color: var(--soft); font-size: 0.8rem; line-height: 1.35; margin-top: 2px; }
.table { overflow-x: auto; }
.table + *, .row + *, section > figure + * { margin-top: 18px; }
table { border-collapse: collapse; width: 100%; font-size: 0.92rem; }
caption { text-align: left; color: var(--soft); font-size: 0.87rem; padding-bottom: 8px; }
th, td { padding: 6px 12px; border-bottom: 1px solid var(--line); vertical-align: top; }
th { border-bottom: 2px solid var(--line); font-weight: 600; line-height: 1.3; }
td { font-variant-numeric: tabular-nums; }
tbody tr:nth-child(even) { background: var(--stripe); }
tbody tr.marked { background: var(--mark); }
tbody tr.strong td { font-weight: 650; }
.left { text-align: left; } .right { text-align: right; } .center { text-align: center; }
.unit { color: var(--soft); font-weight: 400; white-space: nowrap; }
.row { display: grid; grid-template-columns: repeat(auto-fit, minmax(420px, 1fr)); gap: 20px; }
figure { margin: 0; text-align: center; }
figure img {
  display: block; margin: 0 auto; max-width: 100%; height: auto; background: #ffffff;
  border-radius: 6px;
}
figcaption {
  color: var(--soft); font-size: 0.87rem; line-height: 1.45; text-align: left; margin-top: 6px;
}
footer { color: var(--soft); font-size: 0.85rem; padding: 4px 2px; }
@media (prefers-color-scheme: dark) { figure img { padding: 8px; background: #f4f6f8; } }
@media (max-width: 560px) {
  main { padding: 20px 12px; } section { padding: 16px 14px; }
  .row { grid-template-columns: 1fr; }
  section > figure { overflow-x: auto; }
  section > figure img { max-width: max(100%, 660px); }
}
"""
