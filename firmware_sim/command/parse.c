/* SPDX-License-Identifier: MIT */
/* Splits a line into parts, matches headers with patterns, and reads decimal numbers exactly. */
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/decimal.h"
#include "firmware_sim/command/parse.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "core/utf8.h"

/* Not <ctype.h>: what a digit is must not depend on the locale. */
static int is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static int is_blank(char c)
{
    return c == ' ' || c == '\t';
}

static const char *skip_blanks(const char *p)
{
    return p + strspn(p, " \t");
}

static size_t header_span(const char *p)
{
    const size_t star = *p == '*';
    return star + strspn(p + star, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_:");
}

int command_split(const char *line, struct command_request *req, const char **why)
{
    memset(req, 0, sizeof *req);
    size_t len = strlen(line);
    if (len > COMMAND_MAX_LINE) {
        *why = "the line is longer than 256 characters";
        return CMD_E_OVERRUN;
    }
    while (len > 0 && is_blank(line[len - 1]))
        len--;
    memcpy(req->text, line, len);
    const char *p = skip_blanks(req->text);
    req->header = req->param = req->text + len;
    if (*p == '\0') return CMD_E_NONE;
    if (strchr(p, ';') != NULL) {
        *why = "one command per line, no ';'";
        return CMD_E_SYNTAX;
    }
    if (p[0] == ':' && p[1] != '*') p++;
    req->header = p;
    req->header_len = header_span(p);
    p += req->header_len;
    req->query = *p == '?';
    p += req->query;
    if (req->header_len == 0 || (*p != '\0' && !is_blank(*p))) {
        *why = req->header_len == 0 ? "a command begins with a letter, ':' or '*'" : "a blank must follow the header";
        return CMD_E_SYNTAX;
    }
    req->param = req->text + (skip_blanks(p) - req->text);
    return CMD_E_NONE;
}

/* Matches one word of a pattern: its leading part without lower-case letters, or the whole. */
static int node_matches(const char *pattern, size_t pattern_len, const char *text, size_t text_len)
{
    size_t short_len = 0;
    while (short_len < pattern_len && !(pattern[short_len] >= 'a' && pattern[short_len] <= 'z'))
        short_len++;
    if (text_len != pattern_len && text_len != short_len) return 0;
    return strncasecmp(pattern, text, text_len) == 0;
}

int command_word_matches(const char *pattern, const char *word)
{
    return node_matches(pattern, strlen(pattern), word, strlen(word));
}

int command_header_matches(const char *pattern, const char *header, size_t len)
{
    const char *const end = header + len;
    const char *text = header; /* NULL once the last word is taken: "A:" is not "A" */
    while (*pattern != '\0') {
        const int optional = *pattern == '[';
        pattern += strspn(pattern, "[:");
        const size_t pattern_len = strcspn(pattern, "[:]");
        const char *colon = text == NULL ? NULL : memchr(text, ':', (size_t)(end - text));
        const size_t text_len = text == NULL ? 0 : (size_t)((colon == NULL ? end : colon) - text);
        if (text != NULL && node_matches(pattern, pattern_len, text, text_len))
            text = colon == NULL ? NULL : colon + 1;
        else if (!optional)
            return 0;
        pattern += pattern_len;
        pattern += strspn(pattern, "]");
    }
    return text == NULL;
}

/* Reads the optional exponent; without one, returns p. Once the exponent has reached 32000 (IEEE 488.2, 7.7.2.4.1),
 * further digits are passed over: no mantissa of one line brings such a value back into any range. */
static const char *parse_exponent(const char *p, int *exponent)
{
    *exponent = 0;
    const char *q = skip_blanks(p);
    if (*q != 'e' && *q != 'E') return p;
    q = skip_blanks(q + 1);
    const int negative = *q == '-';
    if (*q == '-' || *q == '+') q++;
    if (!is_digit(*q)) return p;
    for (; is_digit(*q); q++)
        if (*exponent < 32000) *exponent = *exponent * 10 + (*q - '0');
    if (negative) *exponent = -*exponent;
    return q;
}

const char *command_parse_decimal(const char *text, struct command_decimal *decimal)
{
    memset(decimal, 0, sizeof *decimal);
    const char *p = text;
    decimal->negative = *p == '-';
    if (*p == '-' || *p == '+') p++;
    int seen = 0, point = 0, fraction = 0;
    for (; is_digit(*p) || (*p == '.' && !point); p++) {
        if (*p == '.') {
            point = 1;
            continue;
        }
        seen = 1;
        fraction += point;
        if (decimal->n_digits == 0 && *p == '0') continue;
        if (decimal->n_digits >= COMMAND_MAX_LINE) return NULL;
        decimal->digits[decimal->n_digits++] = *p;
    }
    if (!seen) return NULL;
    p = parse_exponent(p, &decimal->exponent);
    decimal->exponent -= fraction;
    while (decimal->n_digits > 0 && decimal->digits[decimal->n_digits - 1] == '0') {
        decimal->n_digits--;
        decimal->exponent++;
    }
    return skip_blanks(p);
}

enum command_fit command_decimal_to_wide(const struct command_decimal *decimal, int shift, __int128 *value)
{
    const int zeros = decimal->exponent + shift;
    *value = 0;
    if (decimal->n_digits == 0) return COMMAND_FIT_EXACT;
    if (zeros < 0) return COMMAND_FIT_FINE;
    if (decimal->n_digits + zeros > 20) return COMMAND_FIT_BIG;
    for (int i = 0; i < decimal->n_digits + zeros; i++)
        *value = *value * 10 + (i < decimal->n_digits ? decimal->digits[i] - '0' : 0);
    if (decimal->negative) *value = -*value;
    return COMMAND_FIT_EXACT;
}

enum command_fit command_decimal_to_int(const struct command_decimal *decimal, int shift, int64_t *value)
{
    __int128 wide;
    const enum command_fit fit = command_decimal_to_wide(decimal, shift, &wide);
    const int fits = wide >= -INT64_MAX && wide <= INT64_MAX;
    *value = fits ? (int64_t)wide : 0;
    return fits ? fit : COMMAND_FIT_BIG;
}

double command_decimal_to_double(const struct command_decimal *decimal)
{
    char text[COMMAND_MAX_LINE + 32];
    snprintf(text, sizeof text, "%s0%.*se%d", decimal->negative ? "-" : "", decimal->n_digits, decimal->digits,
             decimal->exponent);
    return strtod(text, NULL);
}

const char *command_take_field(const char *text, char field[COMMAND_FIELD_LEN], size_t *len)
{
    const char *begin = text + strspn(text, " \t");
    const size_t all = strcspn(begin, ",");
    *len = all;
    while (*len > 0 && (begin[*len - 1] == ' ' || begin[*len - 1] == '\t'))
        --*len;
    snprintf(field, COMMAND_FIELD_LEN, "%.*s", (int)(*len < COMMAND_FIELD_LEN ? *len : COMMAND_FIELD_LEN - 1), begin);
    return begin[all] == ',' ? begin + all + 1 : NULL;
}

void command_format_fixed(char *buf, size_t len, int64_t value, int decimals)
{
    uint64_t magnitude = value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
    uint64_t one = 1;
    for (int i = 0; i < decimals; i++)
        one *= 10;
    uint64_t fraction = magnitude % one;
    while (decimals > 0 && fraction % 10 == 0) {
        fraction /= 10;
        decimals--;
    }
    const char *sign = value < 0 ? "-" : "";
    if (decimals == 0)
        snprintf(buf, len, "%s%llu", sign, (unsigned long long)(magnitude / one));
    else
        snprintf(buf, len, "%s%llu.%0*llu", sign, (unsigned long long)(magnitude / one), decimals,
                 (unsigned long long)fraction);
}

void command_clip(char clip[COMMAND_CLIP_LEN], const char *text, size_t len)
{
    const int whole = len < COMMAND_CLIP_LEN;
    const size_t n = whole ? len : utf8_cut(text, COMMAND_CLIP_LEN - 4);
    snprintf(clip, COMMAND_CLIP_LEN, "%.*s%s", (int)n, text, whole ? "" : "...");
}

int command_print_double(char *text, size_t room, double value)
{
    int digits = 15, n;
    do
        n = snprintf(text, room, "%.*g", digits, value);
    while (strtod(text, NULL) != value && digits++ < 17);
    return n;
}
