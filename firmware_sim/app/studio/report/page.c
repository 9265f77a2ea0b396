/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/report/page.h"

#include <inttypes.h>
#include <math.h>

#include "core/studio/picture.h"

static const char STYLE[] =
    ":root{color-scheme:light dark;--ink:#1b1f24;--soft:#57606a;--line:#d0d7de;--page:#fff;--card:#f6f8fa;--a:#2563a8;"
    "--b:#c2571a;--c:#2d7d46;--good:#1a7f37;--bad:#b42318;--open:#6e5a00}\n"
    "@media(prefers-color-scheme:dark){:root{--ink:#e6edf3;--soft:#9aa4ae;--line:#3a424b;--page:#0d1117;--card:#161b22;"
    "--a:#6cb1ff;--b:#ffa657;--c:#63c98a;--good:#4cc76a;--bad:#ff8a80;--open:#e3c04a}}\n"
    "*{box-sizing:border-box}\n"
    "body{margin:0 auto;max-width:76rem;padding:1.5rem;background:var(--page);color:var(--ink);"
    "font:16px/1.5 system-ui,sans-serif}\n"
    "h1{font-size:1.6rem;line-height:1.25;margin:0 0 .5rem;overflow-wrap:anywhere}\n"
    "h2{font-size:1.2rem;margin:2rem 0 .5rem;border-bottom:1px solid var(--line);padding-bottom:.25rem}\n"
    "p{max-width:46rem;margin:.5rem 0}.soft,caption,figcaption{color:var(--soft);font-size:.875rem}\n"
    ".verdict{border:2px solid;border-radius:.5rem;padding:.75rem 1rem;margin:1rem 0;overflow-wrap:anywhere}\n"
    ".verdict b{display:block}.within{border-color:var(--good)}.within b{color:var(--good)}\n"
    ".beyond{border-color:var(--bad)}.beyond b{color:var(--bad)}.open{border-color:var(--open)}.open b{color:var(--open)}\n"
    "dl.facts{display:grid;grid-template-columns:max-content 1fr;gap:.15rem 1rem;margin:.5rem 0}\n"
    "dl.facts dt{color:var(--soft)}dl.facts dd{margin:0;overflow-wrap:anywhere}\n"
    ".cards{display:grid;grid-template-columns:repeat(auto-fill,minmax(10.5rem,1fr));gap:.5rem;margin:1rem 0}\n"
    ".cards div{background:var(--card);border:1px solid var(--line);border-radius:.5rem;padding:.5rem .75rem}\n"
    ".cards b{display:block;font-size:1.2rem;font-variant-numeric:tabular-nums}.cards span{color:var(--soft);"
    "font-size:.85rem}\n"
    ".pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(28rem,100%),1fr));gap:1rem}\n"
    "figure{margin:.5rem 0;break-inside:avoid}svg{display:block;width:100%;height:auto}\n"
    "svg text{fill:var(--ink);font:12px system-ui,sans-serif}svg .soft{fill:var(--soft)}\n"
    "svg .axis{stroke:var(--line);stroke-width:1}svg .mark{stroke:var(--ink);stroke-width:2;fill:none}\n"
    ".s0{fill:var(--a);color:var(--a)}.s1{fill:var(--b);color:var(--b)}.s2{fill:var(--c);color:var(--c)}\n"
    ".key{font-size:.8125rem;color:var(--soft);margin:0 0 .25rem;text-align:center}.key span{white-space:nowrap;"
    "margin:0 .4rem}.key i{display:inline-block;border:.35rem solid;margin-right:.35rem}.key .line{border-width:2px 0 0;"
    "width:1rem;vertical-align:.3em;color:var(--ink)}\n"
    ".map{border:1px solid var(--line);background:#fff}.map text{font-size:14px;font-weight:600;fill:#1b1f24;"
    "paint-order:stroke;stroke:#fff;stroke-width:4px;stroke-linejoin:round}.map .mark{stroke:#1b1f24}\n"
    ".map .station{fill:#d1242f;stroke:#fff;stroke-width:1.5}\n"
    "@media screen and (max-width:40rem){body{padding:1rem .75rem}.chart text{font-size:20px}.chart .odd{display:none}"
    ".map text{font-size:20px}}\n"
    ".wide{overflow-x:auto;margin:.75rem 0}caption{max-width:calc(100vw - 2rem)}table{border-collapse:collapse;font-size:.8125rem;font-variant-numeric:tabular-nums;width:100%}\n"
    "th,td{padding:.2rem .3rem;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}\n"
    "tr:first-child>th:first-child,td:first-child{text-align:left;white-space:normal;overflow-wrap:anywhere;"
    "min-width:7rem;position:sticky;left:0;background:var(--page)}\n"
    "thead th[colspan]{text-align:center;border-left:.5rem solid var(--page)}\n"
    "thead th{color:var(--soft);font-weight:600;vertical-align:bottom;white-space:normal}caption{text-align:left}\n"
    "tr{break-inside:avoid}dl.words dt{font-weight:600;margin-top:.5rem}dl.words dd{margin:0;max-width:46rem}\n"
    "@media print{:root{color-scheme:light;--ink:#000;--soft:#444;--line:#bbb;--page:#fff;--card:#fff;--a:#2563a8;"
    "--b:#c2571a;--c:#2d7d46;--good:#1a7f37;--bad:#b42318;--open:#6e5a00}body{max-width:none;padding:0;font-size:10pt}"
    "h2{break-after:avoid}.pair{grid-template-columns:1fr 1fr}.wide{overflow:visible}table{font-size:6.5pt}th,td{padding:.1rem .08rem}.chart text{font-size:14px}.key,.soft,caption,figcaption{font-size:8pt}"
    "tr:first-child>th:first-child,td:first-child{min-width:3.5rem}}\n";

void page_begin(FILE *out, const char *title)
{
    fputs("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
          "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>",
          out);
    picture_put_escaped(out, title);
    fprintf(out, "</title>\n<style>\n%s</style>\n</head>\n<body>\n", STYLE);
}

void page_end(FILE *out)
{
    fputs("</body>\n</html>\n", out);
}

const char *page_unit(double largest_m, double *per_m)
{
    static const struct {
        const char *name;
        double m;
    } unit[] = {{"m", 1.0}, {"mm", 1e-3}, {"\xc2\xb5m", 1e-6}};
    for (int i = 0; i < 3; i++) {
        *per_m = 1.0 / unit[i].m;
        if (fabs(largest_m) >= 0.9995 * unit[i].m) return unit[i].name;
    }
    if (largest_m == 0.0) {
        *per_m = 1e3;
        return "mm";
    }
    *per_m = 1e9;
    return "nm";
}

/* Writes four digits, with three decimals at most. Whole numbers of more than four digits are written in full; 0 has no
 * decimals. */
static void put_digits(FILE *out, double v, int is_signed)
{
    const double a = fabs(v);
    const int decimals = a >= 1000.0 ? 0 : a >= 100.0 ? 1 : a >= 10.0 ? 2 : 3;
    fprintf(out, is_signed ? "%+.*f" : "%.*f", v == 0.0 ? 0 : decimals, v);
}

void page_length(FILE *out, double m, int is_signed)
{
    double per_m;
    if (!isfinite(m)) {
        fputs(isnan(m) ? "\xe2\x80\x93" : "\xe2\x88\x9e", out);
        return;
    }
    const char *unit = page_unit(m, &per_m);
    put_digits(out, m * per_m, is_signed);
    fprintf(out, "&nbsp;%s", unit);
}

void page_count(FILE *out, uint64_t n)
{
    char digits[24];
    const int len = snprintf(digits, sizeof digits, "%" PRIu64, n);
    for (int i = 0; i < len; i++) {
        if (i > 0 && (len - i) % 3 == 0) fputc(',', out);
        fputc(digits[i], out);
    }
}

int page_letters(const char *text)
{
    int n = 0;
    for (; *text != 0; text++)
        n += ((unsigned char)*text & 0xc0) != 0x80;
    return n;
}

void page_number(FILE *out, double v)
{
    if (!isfinite(v))
        fputs("\xe2\x80\x93", out);
    else if (v >= 1000.0 && v < 1e15)
        page_count(out, (uint64_t)llrint(v));
    else
        fprintf(out, "%.4g", v);
}
