/* SPDX-License-Identifier: MIT */
#include "core/scene.h"
#include "core/utf8.h"

/* Where the next character begins. A byte that is no UTF-8 is a character by itself. */
static const char *after_character(const char *p)
{
    const int n = utf8_len(p, 4);
    return p + (n > 0 ? n : 1);
}

int scene_name_fits(const char *pattern, const char *name)
{
    const char *behind_star = NULL, *rest = NULL;
    while (*name != '\0') {
        const int is_escaped = pattern[0] == '\\' && (pattern[1] == '*' || pattern[1] == '?');
        if (*pattern == '*') {
            behind_star = ++pattern;
            rest = name;
        } else if (*pattern == '?') {
            pattern++;
            name = after_character(name);
        } else if (pattern[is_escaped] == *name) {
            pattern += is_escaped + 1;
            name++;
        } else if (behind_star != NULL) {
            /* The last star takes one more character. Earlier stars needn't: what they leave is the longest rest. */
            name = rest = after_character(rest);
            pattern = behind_star;
        } else
            return 0;
    }
    while (*pattern == '*')
        pattern++;
    return *pattern == '\0';
}
