#include "offline/studies/plain_page.h"

#include <fmt/format.h>

#include "common/files/markup.h"

namespace tumbler {

std::string PlainPageHead(std::string_view title, std::string_view by_day,
                          std::string_view by_night, std::string_view style) {
  return fmt::format(R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{}</title><style>
:root {{ color-scheme: light; --paper: #fff; --ink: #1c2330; --dim: #5d6778; --line: #c8cfda; --empty: #f1f3f6; {} }}
@media screen and (prefers-color-scheme: dark) {{
  :root {{ color-scheme: dark; --paper: #13161a; --ink: #e8e9ea; --dim: #9ba3ac; --line: #2d333a; --empty: #1f242a; {} }}
}}
body {{ font: 15px/1.45 system-ui, sans-serif; color: var(--ink); background: var(--paper); margin: 2rem auto;
  max-width: 62rem; padding: 0 1rem; overflow-wrap: break-word; }}
h1 {{ font-size: 1.5rem; margin: 0 0 .2rem; }} h2 {{ font-size: 1.1rem; margin: 1.8rem 0 .4rem; }}
h2, h2 + p, h2 + p + p {{ break-after: avoid; }}
p {{ margin: .3rem 0; }} table {{ border-collapse: collapse; }}
td, th {{ padding: .15rem .8rem .15rem 0; text-align: left; vertical-align: top; }}
td.n {{ text-align: right; white-space: nowrap; }} .dim {{ color: var(--dim); }}
svg {{ display: block; width: 100%; break-inside: avoid; -webkit-print-color-adjust: exact; print-color-adjust: exact; }}
{}
@media print {{ body {{ margin: 0; max-width: none; padding: 0; font-size: 12px; }} }}
</style></head><body>
)",
                     MarkupText(title), by_day, by_night, style);
}

}  // namespace tumbler
