/* SPDX-License-Identifier: MIT */
/* Texts to values: exact decimals, ranges, words, paths. */
#include "firmware_sim/command/decimal.h"
#include "firmware_sim/config/profile.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/table/diagnostics.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/utf8.h"

static int is_digit(char c)
{
    return c >= '0' && c <= '9';
}

/* Reads a number as YAML has it: of what a command takes, without blanks, and with digits about the point. */
static int read_decimal(const char *text, struct command_decimal *decimal)
{
    const char *end = command_parse_decimal(text, decimal), *point = strchr(text, '.');
    const char *whole = text + strspn(text, "+-");
    return end != NULL && *end == '\0' && strpbrk(text, " \t") == NULL && is_digit(*whole) &&
           (*whole != '0' || !is_digit(whole[1])) && (point == NULL || is_digit(point[1]));
}

const char *cfg_parse_decimal(const char *text, int decimals, __int128 *out)
{
    struct command_decimal decimal;
    if (!read_decimal(text, &decimal)) return "not a number";
    const enum command_fit fit = command_decimal_to_wide(&decimal, decimals, out);
    if (fit == COMMAND_FIT_FINE) return decimals > 0 ? "finer than 6 decimals" : "not a whole number";
    return fit == COMMAND_FIT_BIG ? "out of range" : NULL;
}

int64_t cfg_figure(const struct config_profile *profile, const char *path)
{
    int64_t value;
    memcpy(&value, (const char *)profile + cfg_find(&cfg_profile_table, path)->offset, sizeof value);
    return value;
}

double cfg_real_figure(const struct config_profile *profile, const char *path)
{
    double value;
    memcpy(&value, (const char *)profile + cfg_find(&cfg_profile_table, path)->offset, sizeof value);
    return value;
}

/* Writes the limit that a profile gives: its figure, or, without a profile, the limit of all profiles. */
static void profile_limit(const char *path, double any, const struct config_profile *profile, char *buf)
{
    if (path != NULL) snprintf(buf, 64, "%.15g", profile != NULL ? from_micro(cfg_figure(profile, path)) : any);
}

static void allowed_range(const struct cfg_key *key, const struct config_profile *profile, char *buf)
{
    char low[64], high[64];
    const char *kind = key->type == CFG_COUNT    ? "a whole number, "
                       : key->type == CFG_VEC3   ? "[x, y, z], each "
                       : key->type == CFG_PAIR   ? "[low, high], each "
                       : key->type == CFG_POINTS ? "[[x, y], ...], each "
                                                 : "";
    snprintf(low, sizeof low, "%.10g", key->min);
    snprintf(high, sizeof high, "%.10g", key->max);
    if (key->type == CFG_COUNT && key->max >= 0x1p64) snprintf(high, sizeof high, "%" PRIu64, UINT64_MAX);
    const struct cfg_key *least = key->min_key != NULL ? cfg_find(&cfg_profile_table, key->min_key) : key;
    const struct cfg_key *most = key->max_key != NULL ? cfg_find(&cfg_profile_table, key->max_key) : key;
    profile_limit(key->min_key, least->min, profile, low);
    profile_limit(key->max_key, most->max, profile, high);
    snprintf(buf, CFG_ALLOWED_MAX, "allowed %s%s to %s%s%s%s", kind, low, high, key->unit != NULL ? " " : "",
             key->unit != NULL ? key->unit : "",
             key->max_key == NULL || profile != NULL ? "" : ", within the limits of the head profile");
}

static void allowed_words(const struct cfg_key *key, char *buf)
{
    snprintf(buf, CFG_ALLOWED_MAX, "allowed %s", key->names[0]);
    for (size_t i = 1; key->names[i] != NULL; i++)
        cfg_list_add(buf, CFG_ALLOWED_MAX, key->names[i]);
}

const char *cfg_allowed(const struct cfg_key *key, const struct config_profile *profile, char *buf)
{
    const char *text = key->allowed;
    if (key->type == CFG_MAP) text = "a section with keys";
    if (key->type == CFG_BOOL) text = "on or off";
    if (text != NULL)
        snprintf(buf, CFG_ALLOWED_MAX, "allowed %s", text);
    else if (key->type == CFG_LIST)
        snprintf(buf, CFG_ALLOWED_MAX, "allowed a list of %.0f to %.0f", key->min, key->max);
    else if (key->type == CFG_ENUM)
        allowed_words(key, buf);
    else if (key->type == CFG_TEXT || key->type == CFG_PATH)
        snprintf(buf, CFG_ALLOWED_MAX, "allowed %s of 1 to %zu bytes%s", key->type == CFG_PATH ? "a path" : "text",
                 key->size - 1, key->flags & CFG_ASCII ? ", printable ASCII without comma, ';' and quotes" : "");
    else
        allowed_range(key, profile, buf);
    return buf;
}

struct place {
    struct cfg_reader *rd;
    const struct cfg_key *key;
    uint32_t item;
    int line;
};

/* Reports `"TEXT" is WHAT; allowed ...` for a key's value. */
static int refuse(const struct place *at, const char *text, const char *what)
{
    char shown[CFG_SHOW_MAX], allowed[CFG_ALLOWED_MAX];
    return cfg_fail_value(at->rd, at->key, at->item, at->line, "\"%s\" is %s; %s", cfg_show(text, shown), what,
                          cfg_allowed(at->key, at->rd->profile, allowed));
}

static const char *parse_hex(const char *text, __int128 *out)
{
    if (strncmp(text, "0x", 2) != 0) return "without 0x";
    size_t n = strspn(text + 2, "0123456789abcdefABCDEF");
    if (n == 0 || text[2 + n] != '\0') return "not a number";
    *out = (__int128)strtoull(text, NULL, 16);
    return n > 16 ? "out of range" : NULL;
}

static int store_whole(const struct place *at, void *dst, const char *text)
{
    const struct cfg_key *key = at->key;
    int decimals = key->type == CFG_MICRO ? 6 : 0;
    __int128 value, unit = key->type == CFG_MICRO ? 1000000 : 1;
    const char *wrong = key->flags & CFG_HEX ? parse_hex(text, &value) : cfg_parse_decimal(text, decimals, &value);
    if (wrong != NULL) return refuse(at, text, wrong);
    /* Limits are doubles: the double 0.01 is a little more than 0.01, and 2^64 - 1 rounds up to 2^64. */
    if ((long double)value < roundl((long double)key->min * (long double)unit) ||
        (long double)value > roundl((long double)key->max * (long double)unit) || value > (__int128)UINT64_MAX)
        return refuse(at, text, "out of range");
    if (key->size == sizeof(uint32_t)) {
        uint32_t narrow = (uint32_t)value;
        memcpy(dst, &narrow, sizeof narrow);
    } else {
        uint64_t wide = (uint64_t)value;
        memcpy(dst, &wide, sizeof wide);
    }
    return SH_OK;
}

static int store_real(const struct place *at, double *dst, const char *text)
{
    struct command_decimal decimal;
    if (!read_decimal(text, &decimal)) return refuse(at, text, "not a number");
    double value = strtod(text, NULL);
    if (!isfinite(value) || value < at->key->min || value > at->key->max) return refuse(at, text, "out of range");
    memcpy(dst, &value, sizeof value);
    return SH_OK;
}

static int store_word(const struct place *at, void *dst, const char *text)
{
    static const char *const bools[] = {"off", "on", NULL};
    const char *const *names = at->key->type == CFG_BOOL ? bools : at->key->names;
    const char *word = strcmp(text, "false") == 0 ? "off" : strcmp(text, "true") == 0 ? "on" : text;
    for (int value = 0; names[value] != NULL; value++) {
        if (strcmp(names[value], word) != 0) continue;
        memcpy(dst, &value, sizeof value);
        return SH_OK;
    }
    return refuse(at, text, "not known");
}

static int store_text(const struct place *at, char *dst, const char *text, const char *base_dir)
{
    if (text[0] == '\0') return refuse(at, text, "empty");
    for (const char *p = text; *p != '\0'; p++) {
        unsigned char c = (unsigned char)*p;
        if (c < 0x20 || c == 0x7f) return refuse(at, text, "text with control characters");
        if ((at->key->flags & CFG_ASCII) && (c >= 0x80 || strchr(",;\"'", c) != NULL))
            return refuse(at, text, "text with a character that not all clients can carry");
    }
    const char *before = "";
    if (at->key->type == CFG_PATH && text[0] != '/') before = base_dir;
    if (at->key->type == CFG_TEXT && !utf8_is_valid(text)) /* on the command line; libyaml checks files */
        return refuse(at, text, "not UTF-8");
    if (strlen(before) + strlen(text) >= at->key->size)
        return refuse(at, text, before[0] != '\0' ? "too long with the folder of its file" : "too long");
    snprintf(dst, at->key->size, "%s%s", before, text);
    return SH_OK;
}

/* Stores "[1, 2, 3]" or "1,2,3", as --set and defaults have them. */
static int store_vec3_text(const struct place *at, double *dst, const char *text)
{
    const int last = cfg_axes(at->key) - 1;
    const char *wrong = last == 1 ? "not [low, high]" : "not [x, y, z]";
    char part[CFG_SHOW_MAX];
    const char *p = text;
    int closed = *p == '[';
    p += closed;
    for (int axis = 0; axis <= last; axis++) {
        p += strspn(p, " ");
        size_t len = strcspn(p, axis < last ? " ," : " ]");
        if (len == 0 || len >= sizeof part) return refuse(at, text, wrong);
        memcpy(part, p, len);
        part[len] = '\0';
        p += len;
        p += strspn(p, " ");
        if (axis < last && *p++ != ',') return refuse(at, text, wrong);
        int code = store_real(at, dst + axis, part);
        if (code != SH_OK) return code;
    }
    return strcmp(p, closed ? "]" : "") == 0 ? SH_OK : refuse(at, text, wrong);
}

int cfg_store_number(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, int line, double *dst,
                     const char *text)
{
    struct place at = {rd, key, item, line};
    return store_real(&at, dst, text);
}

int cfg_store(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, int line, const char *text,
              const char *base_dir)
{
    struct place at = {rd, key, item, line};
    void *dst = cfg_address(rd, key, item);
    switch (key->type) {
    case CFG_BOOL:
    case CFG_ENUM:
        return store_word(&at, dst, text);
    case CFG_COUNT:
    case CFG_MICRO:
        return store_whole(&at, dst, text);
    case CFG_REAL:
        return store_real(&at, dst, text);
    case CFG_TEXT:
    case CFG_PATH:
        return store_text(&at, dst, text, base_dir);
    case CFG_VEC3:
    case CFG_PAIR:
        return store_vec3_text(&at, dst, text);
    default:
        return refuse(&at, text, "not what belongs here");
    }
}

const char *cfg_dir_of(const char *path, char *buf)
{
    snprintf(buf, CONFIG_PATH_LEN, "%.*s", (int)(basename(path) - path), path);
    return buf;
}
