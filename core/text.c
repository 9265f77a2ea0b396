/* SPDX-License-Identifier: MIT */
#include "core/text.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include "core/huge_pages.h"
#include "core/infile.h"

/* The file is read, not mapped: one that shrinks while it is mapped would end the process. */
static int read_whole(struct text *t, FILE *f, text_progress *progress, void *ctx, struct sh_err *err)
{
    struct stat st;
    if (fstat(fileno(f), &st) != 0) return text_fail(t, 0, SH_EINPUT, err, "%s", strerror(errno));
    t->size = (size_t)st.st_size;
    t->data = huge_pages_alloc(t->size + 1);
    if (t->data == NULL) return text_fail(t, 0, SH_ENOMEM, err, "no memory for %zu bytes", t->size);
    const size_t step = (size_t)16 << 20;
    for (size_t at = 0; at < t->size;) {
        size_t want = t->size - at < step ? t->size - at : step;
        size_t got = fread(t->data + at, 1, want, f);
        if (got < want)
            return text_fail(t, 0, SH_EINPUT, err, "%s", ferror(f) ? strerror(errno) : "got shorter while it was read");
        at += got;
        int rc = progress != NULL ? progress(ctx, -1.0, err) : SH_OK;
        if (rc != SH_OK) return rc;
    }
    t->data[t->size] = '\0';
    return SH_OK;
}

int text_fail(const struct text *t, uint64_t line, int code, struct sh_err *err, const char *fmt, ...)
{
    enum { LONGEST = 120 };
    size_t len = strlen(t->path);
    bool cut = len > LONGEST;
    char place[48] = "", what[320];
    if (line > 0) snprintf(place, sizeof place, ", line %llu", (unsigned long long)line);
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(what, sizeof what, fmt, ap);
    va_end(ap);
    return sh_fail(err, code, "%s%s%s: %s", cut ? "..." : "", t->path + (cut ? len - LONGEST : 0), place, what);
}

int text_open(struct text *t, const char *path, text_progress *progress, void *ctx, struct sh_err *err)
{
    *t = (struct text){.path = path, .line = 1};
    const char *why;
    FILE *f = infile_open(path, &why);
    if (f == NULL) return text_fail(t, 0, SH_EINPUT, err, "%s", why);
    int rc = read_whole(t, f, progress, ctx, err);
    fclose(f);
    if (rc != SH_OK) return rc;
    t->p = t->data;
    t->end = t->data + t->size;
    if (t->size >= 3 && memcmp(t->p, "\xef\xbb\xbf", 3) == 0) t->p += 3; /* the byte order mark of UTF-8 */
    t->c_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    if (t->c_locale == (locale_t)0) return text_fail(t, 0, SH_ENOMEM, err, "no memory for a locale");
    return SH_OK;
}

void text_drop_read(struct text *t)
{
    const size_t block = (size_t)2 << 20; /* a huge page, which can only be given back whole */
    const size_t first = (block - (uintptr_t)t->data % block) % block, read = (size_t)(t->p - t->data);
    const size_t from = t->n_dropped > first ? t->n_dropped : first;
    if (read < from + block) return;
    t->n_dropped = from + (read - from) / block * block;
    madvise(t->data + from, t->n_dropped - from, MADV_DONTNEED);
}

void text_close(struct text *t)
{
    free(t->data);
    if (t->c_locale != (locale_t)0) freelocale(t->c_locale);
    *t = (struct text){0};
}

/* Length of the line end at p, which is before t->end; 0 when there is none. */
static size_t line_end_len(const struct text *t, const char *p)
{
    if (p < t->end && *p == '\n') return 1;
    if (p < t->end && *p == '\r') return p + 1 < t->end && p[1] == '\n' ? 2 : 1;
    return 0;
}

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}

void text_skip_blanks(struct text *t)
{
    while (t->p < t->end) {
        size_t hidden = t->continued && *t->p == '\\' ? line_end_len(t, t->p + 1) : 0;
        if (hidden > 0) {
            t->p += 1 + hidden;
            t->line++;
        } else if (is_blank(*t->p)) {
            t->p++;
        } else {
            return;
        }
    }
}

bool text_at_line_end(const struct text *t)
{
    return t->p >= t->end || *t->p == '\n' || *t->p == '\r';
}

void text_next_line(struct text *t)
{
    while (!text_at_line_end(t))
        t->p++;
    if (t->p >= t->end) return;
    t->p += line_end_len(t, t->p);
    t->line++;
}

/* A word ends at a blank, a line's end, or a backslash that hides a line's end. */
static bool at_word_end(const struct text *t, const char *p)
{
    if (p >= t->end || is_blank(*p) || *p == '\n' || *p == '\r') return true;
    return t->continued && *p == '\\' && line_end_len(t, p + 1) > 0;
}

bool text_at_word_end(const struct text *t)
{
    return at_word_end(t, t->p);
}

struct text_span text_word(struct text *t)
{
    text_skip_blanks(t);
    const char *from = t->p;
    while (!at_word_end(t, t->p))
        t->p++;
    return (struct text_span){from, (size_t)(t->p - from)};
}

struct text_span text_rest(struct text *t)
{
    while (t->p < t->end && is_blank(*t->p))
        t->p++;
    struct text_span rest = {t->p, 0};
    while (!text_at_line_end(t))
        t->p++;
    rest.n = (size_t)(t->p - rest.p);
    while (rest.n > 0 && is_blank(rest.p[rest.n - 1]))
        rest.n--;
    return rest;
}

bool text_is(struct text_span span, const char *text)
{
    return span.n == strlen(text) && memcmp(span.p, text, span.n) == 0;
}

bool text_is_word(struct text_span span, const char *word)
{
    return span.n == strlen(word) && strncasecmp(span.p, word, span.n) == 0;
}

bool text_is_one_of(struct text_span span, const char *const *list)
{
    for (; *list != NULL; list++)
        if (text_is(span, *list)) return true;
    return false;
}

bool text_integer(struct text *t, int64_t *value)
{
    const char *p = t->p;
    bool negative = *p == '-';
    if (*p == '-' || *p == '+') p++;
    const char *digits = p;
    int64_t v = 0;
    while (*p >= '0' && *p <= '9' && p - digits < 18)
        v = v * 10 + (*p++ - '0');
    if (p == digits || (*p >= '0' && *p <= '9')) return false;
    *value = negative ? -v : v;
    t->p = p;
    return true;
}

/* A decimal number taken apart: digits * 10^exponent; simple: the two hold the number exactly. */
struct decimal {
    uint64_t digits;
    int exponent;
    bool negative, simple;
};

/* Returns the number's end, NULL when it isn't one. The file's NUL stops every loop. */
static const char *scan_decimal(const char *p, struct decimal *d)
{
    *d = (struct decimal){.negative = *p == '-', .simple = true};
    if (*p == '-' || *p == '+') p++;
    int n_digits = 0;
    bool fraction = false;
    for (;; p++) {
        if (*p == '.' && !fraction) {
            fraction = true;
            continue;
        }
        if (*p < '0' || *p > '9') break;
        n_digits++;
        if (d->digits < UINT64_C(100000000000000000))
            d->digits = d->digits * 10 + (uint64_t)(*p - '0');
        else
            d->simple = false;
        if (fraction && d->exponent > -1000) d->exponent--;
    }
    if (n_digits == 0) return NULL;
    d->simple &= d->exponent > -1000; /* at this limit decimals are no longer counted */
    if (*p != 'e' && *p != 'E') return p;
    p++;
    bool down = *p == '-';
    if (*p == '-' || *p == '+') p++;
    if (*p < '0' || *p > '9') return NULL;
    int power = 0;
    for (; *p >= '0' && *p <= '9'; p++)
        if (power < 10000) power = power * 10 + (*p - '0');
    d->exponent += down ? -power : power;
    return p;
}

bool text_number(struct text *t, double *value)
{
    static const double power[23] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                     1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    struct decimal d;
    const char *end = scan_decimal(t->p, &d);
    /* Digits below 2^53 and powers up to 10^22 are exact doubles, so one operation rounds once, correctly. */
    if (end != NULL && d.simple && d.digits <= (UINT64_C(1) << 53) && d.exponent >= -22 && d.exponent <= 22) {
        double v = (double)d.digits;
        v = d.exponent < 0 ? v / power[-d.exponent] : v * power[d.exponent];
        *value = d.negative ? -v : v;
    } else {
        const char *p = t->p + (*t->p == '-' || *t->p == '+');
        if (end == NULL && *p != 'n' && *p != 'N' && *p != 'i' && *p != 'I') return false;
        char *parsed;
        *value = strtod_l(t->p, &parsed, t->c_locale);
        if (parsed == t->p || (end != NULL && parsed != end)) return false;
        end = parsed;
    }
    if (!at_word_end(t, end)) return false;
    t->p = end;
    return true;
}
