/* SPDX-License-Identifier: MIT */
#include "core/import/ifc/step.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static uint64_t step_count(const char *p, const char *end, char what)
{
    uint64_t n = 0;
    for (; (p = memchr(p, what, (size_t)(end - p))) != NULL; p++)
        n++;
    return n;
}

/* Overwrites comments with blanks. A quote within a text is written twice, which counts as the end of one text and the
 * start of the next. */
static int blank_comments(struct text *t, struct sh_err *err)
{
    uint64_t line = 1, opened = 0;
    int quoted = 0;
    if (memmem(t->data, t->size, "/*", 2) == NULL && step_count(t->data, t->data + t->size, '\'') % 2 == 0)
        return SH_OK; /* most files */
    for (char *p = t->data, *end = t->data + t->size; p < end; p++) {
        if (*p == '\n') line++;
        if (*p == '\'') {
            quoted = !quoted;
            opened = line;
        }
        if (quoted || *p != '/' || p[1] != '*') continue;
        opened = line;
        char *close = strstr(p + 2, "*/");
        if (close == NULL) return text_fail(t, opened, SH_EINPUT, err, "not STEP: a comment without an end");
        for (; p < close + 2; p++)
            if (*p == '\n')
                line++;
            else
                *p = ' ';
        p--;
    }
    return quoted ? text_fail(t, opened, SH_EINPUT, err, "not STEP: a text without an end") : SH_OK;
}

int step_open(struct text *t, const char *path, struct sh_err *err)
{
    int rc = text_open(t, path, NULL, NULL, err);
    if (rc == SH_OK && (t->end - t->p < 12 || strncmp(t->p, "ISO-10303-21", 12) != 0)) /* after a byte order mark */
        rc = text_fail(t, 1, SH_EINPUT, err, "not STEP: it doesn't begin with ISO-10303-21");
    return rc == SH_OK ? blank_comments(t, err) : rc;
}

static void skip_space(struct text *t)
{
    for (; t->p < t->end && (*t->p == ' ' || *t->p == '\t' || *t->p == '\r' || *t->p == '\n'); t->p++)
        t->line += *t->p == '\n';
}

/* Returns the ';' that ends the statement at p, or NULL at the end of the file, and counts lines. A ';' within a text,
 * after an odd number of quotes, ends nothing. */
static const char *find_end(struct text *t)
{
    uint64_t quotes = 0;
    for (const char *p = t->p, *end; (end = memchr(p, ';', (size_t)(t->end - p))) != NULL; p = end + 1) {
        t->line += step_count(p, end, '\n');
        quotes += step_count(p, end, '\'');
        if (quotes % 2 == 0) return end;
    }
    return NULL;
}

static struct text_span trim(const char *p, const char *end)
{
    while (p < end && strchr(" \t\r\n", *p) != NULL)
        p++;
    while (end > p && strchr(" \t\r\n", end[-1]) != NULL)
        end--;
    return (struct text_span){p, (size_t)(end - p)};
}

static int read_record(const struct text *t, struct text_span all, struct step_record *r, struct sh_err *err)
{
    const char *p = all.p + 1, *end = all.p + all.n, *open = memchr(all.p, '(', all.n);
    const char *equals = memchr(all.p, '=', all.n);
    r->id = 0;
    for (; p < end && *p >= '0' && *p <= '9' && r->id < UINT64_MAX / 20; p++)
        r->id = 10 * r->id + (uint64_t)(*p - '0');
    if (p == all.p + 1 || equals == NULL || trim(p, equals).n != 0 || open == NULL || open < equals || end[-1] != ')')
        return text_fail(t, r->line, SH_EINPUT, err, "not STEP: this is no record of the form #1= TYPE(...);");
    r->type = trim(equals + 1, open);
    r->args = (struct text_span){open + 1, (size_t)(end - open - 2)};
    return 1;
}

int step_next(struct text *t, struct step_record *record, struct sh_err *err)
{
    for (;;) {
        skip_space(t);
        if (t->p >= t->end) return 0;
        const char *start = t->p;
        record->line = t->line;
        const char *end = find_end(t);
        if (end == NULL) return text_fail(t, record->line, SH_EINPUT, err, "not STEP: a record without its ';'");
        t->p = end + 1;
        if (*start == '#') return read_record(t, trim(start, end), record, err);
    }
}

size_t step_split(struct text_span list, struct text_span *part, size_t max)
{
    size_t n = 0;
    int depth = 0, quoted = 0;
    const char *start = list.p, *end = list.p + list.n;
    if (trim(start, end).n == 0) return 0;
    for (const char *p = start; p <= end; p++) {
        if (p < end) {
            if (*p == '\'') quoted = !quoted;
            if (quoted) continue;
            depth += (*p == '(') - (*p == ')');
            if (*p != ',' || depth > 0) continue;
        }
        if (n < max) part[n] = trim(start, p);
        n++;
        start = p + 1;
    }
    return n;
}

int step_list(struct text_span span, struct text_span *inside)
{
    if (span.n < 2 || span.p[0] != '(' || span.p[span.n - 1] != ')') return 0;
    *inside = (struct text_span){span.p + 1, span.n - 2};
    return 1;
}

int step_reference(struct text_span span, uint64_t *id)
{
    long value;
    if (span.n < 2 || span.p[0] != '#') return 0;
    if (!step_integer((struct text_span){span.p + 1, span.n - 1}, &value) || value < 0) return 0;
    *id = (uint64_t)value;
    return 1;
}

int step_integer(struct text_span span, long *value)
{
    size_t sign = span.n > 0 && (span.p[0] == '-' || span.p[0] == '+');
    if (span.n == sign || span.n > 18) return 0;
    for (size_t i = sign; i < span.n; i++)
        if (span.p[i] < '0' || span.p[i] > '9') return 0;
    *value = strtol(span.p, NULL, 10);
    return 1;
}

int step_real(const struct text *t, struct text_span span, double *value)
{
    char *end;
    if (span.n == 0 || strspn(span.p, "+-.0123456789eE") < span.n) return 0;
    *value = strtod_l(span.p, &end, t->c_locale);
    return end == span.p + span.n && isfinite(*value);
}
