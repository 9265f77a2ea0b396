/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/batch/sweep.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "drivers/protocol/crc32c.h"
#include "firmware_sim/app/options.h"

enum { NAME_KEPT = 96 };

/* ---- values */

static int add_value(struct batch_sweep *s, const char *value, size_t len, struct sh_err *err)
{
    char *set = NULL;
    if (!resize(&s->set, s->n + (size_t)1, sizeof(char *)) || asprintf(&set, "%s=%.*s", s->key, (int)len, value) < 0)
        return sh_fail(err, SH_ENOMEM, "no memory for the values of %s", s->key);
    for (uint32_t i = 0; i < s->n; i++) {
        if (strcmp(s->set[i], set) != 0) continue;
        free(set);
        return sh_fail(err, SH_EINPUT, "--sweep %s: the value %.*s is given twice", s->key, (int)len, value);
    }
    s->set[s->n++] = set;
    if (s->n > BATCH_MAX_VALUES)
        return sh_fail(err, SH_EINPUT, "--sweep %s: more than %d values", s->key, BATCH_MAX_VALUES);
    return SH_OK;
}

/* Where a value ends: the next comma outside of brackets and quotes, or the end. NULL: a bracket or a quote is open. */
static const char *value_end(const char *p)
{
    int depth = 0;
    char quote = '\0';
    for (; *p != '\0'; p++) {
        if (quote != '\0') {
            if (*p == quote) quote = '\0';
        } else if (*p == '"' || *p == '\'')
            quote = *p;
        else if (*p == '[' || *p == '{')
            depth++;
        else if (*p == ']' || *p == '}')
            depth--;
        else if (*p == ',' && depth == 0)
            break;
        if (depth < 0) return NULL;
    }
    return depth == 0 && quote == '\0' ? p : NULL;
}

static int add_list(struct batch_sweep *s, const char *values, struct sh_err *err)
{
    int rc = SH_OK;
    for (const char *p = values;; p++) {
        const char *end = value_end(p);
        if (end == NULL)
            return sh_fail(err, SH_EINPUT, "--sweep %s=%s: a bracket or a quote is not closed", s->key, values);
        if (end == p)
            return sh_fail(err, SH_EINPUT, "--sweep %s=%s: an empty value; allowed as in %s=A,B", s->key, values,
                           s->key);
        rc = add_value(s, p, (size_t)(end - p), err);
        if (rc != SH_OK || *end == '\0') return rc;
        p = end;
    }
}

/* Whether there are so many steps from FIRST to LAST; below 0: LAST lies in the other direction, or STEP is 0. */
static int check_steps(const struct batch_sweep *s, const char *values, double steps, struct sh_err *err)
{
    if (!(steps >= 0.0))
        return sh_fail(err, SH_EINPUT,
                       "--sweep %s=%s: no value from FIRST to LAST; allowed FIRST:LAST:STEP as in 0:10:2", s->key,
                       values);
    if (steps >= BATCH_MAX_VALUES)
        return sh_fail(err, SH_EINPUT, "--sweep %s=%s: %.9g values; allowed at most %d", s->key, values, steps + 1.0,
                       BATCH_MAX_VALUES);
    return SH_OK;
}

/* The last value may lie beyond LAST by a rounding error: 1e-9 of a step. Values are rounded to the last decimal that a
 * double of the range's size has: 0.3 and not 0.30000000000000004, 0 and not 5.5e-17. A range is refused where this
 * changes a value by more than 1 % of a step. */
static int add_range(struct batch_sweep *s, const char *values, const double range[3], struct sh_err *err)
{
    const double steps = range[2] != 0.0 ? floor((range[1] - range[0]) / range[2] + 1e-9) : -1.0;
    int rc = check_steps(s, values, steps, err);
    if (rc != SH_OK) return rc;
    const double decimals = 14.0 - floor(log10(fmax(fabs(range[0]), fabs(range[1]))));
    const double per_unit = pow(10.0, fmin(fmax(decimals, 0.0), 300.0));
    for (int i = 0; i <= (int)steps; i++) {
        char text[32];
        const double exact = range[0] + i * range[2], value = round(exact * per_unit) / per_unit;
        const int n = snprintf(text, sizeof text, "%.15g", value + 0.0); /* no -0 */
        if (fabs(strtod(text, NULL) - exact) > 0.01 * fabs(range[2]))
            return sh_fail(err, SH_EINPUT,
                           "--sweep %s=%s: a value has more than 15 digits; allowed up to 15, or whole numbers of up "
                           "to 64 bits for FIRST, LAST and STEP",
                           s->key, values);
        if ((rc = add_value(s, text, (size_t)n, err)) != SH_OK) return rc;
    }
    return SH_OK;
}

/* Takes a whole number of up to 64 bits beside its sign at *p, which is moved on after `end`. */
static int take_whole(const char **p, char end, __int128 *out)
{
    const char *digits = *p + (**p == '-' || **p == '+');
    const size_t n = strspn(digits, "0123456789");
    errno = 0;
    const unsigned long long size = strtoull(digits, NULL, 10);
    if (n == 0 || digits[n] != end || errno != 0) return 0;
    *out = **p == '-' ? -(__int128)size : (__int128)size;
    *p = digits + n + (end != '\0');
    return 1;
}

static int read_whole(const char *values, __int128 range[3])
{
    return take_whole(&values, ':', &range[0]) && take_whole(&values, ':', &range[1]) &&
           take_whole(&values, '\0', &range[2]);
}

/* Each digit counts: a seed has up to 20, more than a double. */
static int add_whole_range(struct batch_sweep *s, const char *values, const __int128 range[3], struct sh_err *err)
{
    const __int128 way = range[1] - range[0], step = range[2];
    const int is_empty = step == 0 || (way != 0 && (way < 0) != (step < 0));
    int rc = check_steps(s, values, is_empty ? -1.0 : (double)(way / step), err);
    for (__int128 i = 0; rc == SH_OK && i <= way / step; i++) {
        const __int128 value = range[0] + i * step;
        char text[32];
        const int n = snprintf(text, sizeof text, "%s%llu", value < 0 ? "-" : "",
                               (unsigned long long)(value < 0 ? -value : value));
        rc = add_value(s, text, (size_t)n, err);
    }
    return rc;
}

/* Skips ], so that a[0].b equals a.0.b where [ counts as a point. */
static const char *next_letter(const char *p)
{
    while (*p == ']')
        p++;
    return p;
}

const char *batch_after_key(const char *text, const char *key)
{
    for (text = next_letter(text), key = next_letter(key); *key != '\0';
         text = next_letter(text + 1), key = next_letter(key + 1))
        if ((*text == '[' ? '.' : *text) != (*key == '[' ? '.' : *key)) return NULL;
    return text;
}

int batch_sweeps_add(struct batch_sweeps *sweeps, const char *text, struct sh_err *err)
{
    const char *equals = strchr(text, '=');
    double range[3];
    __int128 whole[3];
    if (equals == NULL || equals == text || equals[1] == '\0')
        return sh_fail(err, SH_EINPUT,
                       "--sweep %s: allowed KEY=A,B,... or KEY=FIRST:LAST:STEP, as in head.prr_hz=300000,600000", text);
    if (sweeps->n == BATCH_MAX_SWEEPS) return sh_fail(err, SH_EINPUT, "--sweep: at most %d keys", BATCH_MAX_SWEEPS);
    struct batch_sweep *s = &sweeps->sweep[sweeps->n++];
    *s = (struct batch_sweep){.key = strndup(text, (size_t)(equals - text))};
    if (s->key == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    for (uint32_t i = 0; i + 1 < sweeps->n; i++) {
        const char *after = batch_after_key(s->key, sweeps->sweep[i].key);
        if (after != NULL && *after == '\0')
            return sh_fail(err, SH_EINPUT, "--sweep %s: the key is given twice; allowed once, with all its values",
                           s->key);
        after = batch_after_key(sweeps->sweep[i].key, s->key);
        if (after != NULL && (*after == '.' || *after == '['))
            return sh_fail(err, SH_EINPUT,
                           "--sweep %s: it would replace the values of --sweep %s; allowed is the other order", s->key,
                           sweeps->sweep[i].key);
    }
    if (read_whole(equals + 1, whole)) return add_whole_range(s, equals + 1, whole, err);
    const int has_blank = strpbrk(equals + 1, " \t") != NULL;
    return !has_blank && app_read_numbers(equals + 1, ':', range, 3) ? add_range(s, equals + 1, range, err)
                                                                     : add_list(s, equals + 1, err);
}

void batch_sweeps_free(struct batch_sweeps *sweeps)
{
    for (uint32_t i = 0; i < sweeps->n; i++) {
        struct batch_sweep *s = &sweeps->sweep[i];
        for (uint32_t k = 0; k < s->n; k++)
            free(s->set[k]);
        free(s->set);
        free(s->key);
    }
    sweeps->n = 0;
}

/* ---- combinations */

int batch_sweeps_count(const struct batch_sweeps *sweeps, uint32_t *n, struct sh_err *err)
{
    uint64_t all = 1;
    for (uint32_t i = 0; i < sweeps->n; i++) {
        all *= sweeps->sweep[i].n;
        if (all > BATCH_MAX_JOBS) return sh_fail(err, SH_EINPUT, "--sweep: more than %d combinations", BATCH_MAX_JOBS);
    }
    *n = (uint32_t)all;
    return SH_OK;
}

void batch_sweeps_at(const struct batch_sweeps *sweeps, uint32_t combination, const char *set[BATCH_MAX_SWEEPS])
{
    for (uint32_t i = sweeps->n; i-- > 0;) {
        const struct batch_sweep *s = &sweeps->sweep[i];
        set[i] = s->set[combination % s->n];
        combination /= s->n;
    }
}

/* ---- stations and shards */

/* A whole number from 1 to `max` at *p, which is moved on. 0: there is none. */
static uint32_t sweep_take_number(const char **p, uint32_t max)
{
    uint64_t number = 0;
    while (**p >= '0' && **p <= '9' && number <= max)
        number = 10 * number + (uint64_t)(*(*p)++ - '0');
    return number <= max ? (uint32_t)number : 0;
}

int batch_stations_parse(const char *text, struct batch_stations *stations, struct sh_err *err)
{
    uint32_t last = 0;
    stations->n = 0;
    stations->all = strcmp(text, "all") == 0;
    if (stations->all) return SH_OK;
    for (const char *p = text;; p++) {
        const uint32_t from = sweep_take_number(&p, CONFIG_MAX_STOPS);
        uint32_t to = from;
        if (*p == '-') {
            p++;
            to = sweep_take_number(&p, CONFIG_MAX_STOPS);
        }
        if (from <= last || to < from || (*p != ',' && *p != '\0'))
            return sh_fail(err, SH_EINPUT, "--stations %s: allowed all, or rising numbers from 1 to %d, as in 1,3-5",
                           text, CONFIG_MAX_STOPS);
        for (last = from; last <= to; last++)
            stations->number[stations->n++] = last;
        last = to;
        if (*p == '\0') return SH_OK;
    }
}

int batch_shard_parse(const char *text, uint32_t *i, uint32_t *n, struct sh_err *err)
{
    const char *p = text;
    *i = sweep_take_number(&p, BATCH_MAX_JOBS);
    *n = 0;
    if (*i > 0 && *p == '/') {
        p++;
        *n = sweep_take_number(&p, BATCH_MAX_JOBS);
    }
    if (*n != 0 && *p == '\0' && *i <= *n) return SH_OK;
    return sh_fail(err, SH_EINPUT, "--shard %s: allowed I/N, from 1/N to N/N, N up to %d", text, BATCH_MAX_JOBS);
}

/* ---- names */

void batch_name(uint32_t number, int digits, uint32_t station, const char *const *set, uint32_t n,
                char name[BATCH_NAME_LEN])
{
    static const char safe[] = "-+.,=_";
    char *all = NULL;
    size_t size;
    FILE *out = open_memstream(&all, &size);
    name[0] = '\0';
    if (out == NULL) return;
    fprintf(out, "%0*u_station-%u", digits, number, station);
    for (uint32_t i = 0; i < n; i++)
        fprintf(out, "_%s", set[i]);
    if (fclose(out) == 0 && size > NAME_KEPT)
        snprintf(name, BATCH_NAME_LEN, "%.*s_%08x", NAME_KEPT, all, crc32c(0, all, size));
    else if (all != NULL)
        snprintf(name, BATCH_NAME_LEN, "%s", all);
    free(all);
    for (char *p = name; *p != '\0'; p++)
        if (!isalnum((unsigned char)*p) && strchr(safe, *p) == NULL) *p = '_';
}
