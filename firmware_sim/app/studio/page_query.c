/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/page_query.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int page_fail_word(const struct page_word *w, const char *text, int len, struct sh_err *err)
{
    return sh_fail(err, SH_EINPUT, "%s=%.*s: allowed %s from %.10g to %.10g", w->name, len, text,
                   w->whole ? "whole numbers" : "numbers", w->min, w->max);
}

/* Whether a name stands again in the rest of a query. */
static int is_given_again(const char *name, size_t len, const char *rest)
{
    for (; *rest != '\0'; rest += strcspn(rest, "&")) {
        rest += *rest == '&';
        if (strncmp(rest, name, len) == 0 && rest[len] == '=') return 1;
    }
    return 0;
}

static int page_read_word(struct page_word *words, const char *text, size_t len, struct sh_err *err)
{
    char known[256] = "", *end;
    const char *equals = memchr(text, '=', len);
    const size_t name_len = equals != NULL ? (size_t)(equals - text) : len;
    for (struct page_word *w = words; w->name != NULL; w++) {
        strncat(known, " ", sizeof known - strlen(known) - 1);
        strncat(known, w->name, sizeof known - strlen(known) - 1);
        if (strlen(w->name) != name_len || memcmp(w->name, text, name_len) != 0) continue;
        if (is_given_again(w->name, name_len, text + len))
            return sh_fail(err, SH_EINPUT, "%s: given twice; allowed once", w->name);
        const int value_len = equals != NULL ? (int)(len - name_len - 1) : 0;
        if (value_len == 0) return page_fail_word(w, "", 0, err);
        w->value = strtod(equals + 1, &end);
        if (end != text + len || strcspn(equals + 1, "xX") < (size_t)(end - equals - 1) ||
            !(w->value >= w->min && w->value <= w->max) || (w->whole && w->value != floor(w->value)))
            return page_fail_word(w, equals + 1, value_len < 64 ? value_len : 64, err);
        return SH_OK;
    }
    return sh_fail(err, SH_EINPUT, "%.*s: unknown; allowed%s%s", (int)(name_len < 64 ? name_len : 64), text, known,
                   words->name == NULL ? " nothing after ?" : "");
}

int page_read_query(struct page_word *words, const char *query, struct sh_err *err)
{
    int rc = SH_OK;
    while (*query != '\0' && rc == SH_OK) {
        const size_t len = strcspn(query, "&");
        if (len > 0) rc = page_read_word(words, query, len, err);
        query += len + (query[len] == '&');
    }
    for (; words->name != NULL && rc == SH_OK; words++)
        if (isnan(words->value))
            rc = sh_fail(err, SH_EINPUT, "%s is needed: %s from %.10g to %.10g", words->name,
                         words->whole ? "whole numbers" : "numbers", words->min, words->max);
    return rc;
}
