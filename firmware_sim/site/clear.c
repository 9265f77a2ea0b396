/* SPDX-License-Identifier: MIT */
/* Surfaces that their file calls transparent, and the rules that would make glass of them. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/config/escape.h"
#include "firmware_sim/site/site.h"

/* Limits the share of light through a pane: it scatters some, even where a file says that all goes through. */
static const double MOST_GLASS = 0.9;

/* Whether a rule about glass or a mirror fits the surface; its value does not matter. */
static int is_decided(const struct scene_surface *s, const struct surface_rule *rule, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        if (surface_rule_fits(&rule[i], s)) return !isnan(rule[i].surface.glass) || !isnan(rule[i].surface.mirror);
    return 0;
}

/* A byte becomes up to four: a control character is written as \xNN, and a line end of three bytes as \uNNNN. A
 * wildcard has a backslash before it, which is doubled for YAML. */
enum { NAME_ROOM = 4 * SCENE_NAME_LEN };

/* Writes a pattern that fits this name alone, as a double-quoted scalar of YAML. */
static void quote(const char *name, char out[NAME_ROOM])
{
    size_t n = 0;
    out[n++] = '"';
    for (const char *p = name; *p != '\0';) {
        char one[CONFIG_ESCAPE_ROOM];
        if (*p == '*' || *p == '?') n += (size_t)snprintf(out + n, NAME_ROOM - n, "\\\\"); /* scene_name_fits */
        p += config_escape(p, one);
        n += (size_t)snprintf(out + n, NAME_ROOM - n, "%s", one);
    }
    out[n++] = '"';
    out[n] = '\0';
}

void site_clear_add(struct site_clear *c, const struct scene_surface *s, const struct surface_rule *rule, uint32_t n)
{
    char name[NAME_ROOM], entry[NAME_ROOM + 48];
    if ((double)s->clear < SITE_CLEAR_LEAST || is_decided(s, rule, n)) return;
    const int by_material = s->material[0] != '\0';
    c->n++;
    quote(by_material ? s->material : s->object, name);
    const int key = snprintf(entry, sizeof entry, "{%s: %s, ", by_material ? "material" : "object", name);
    if (strstr(c->rules, entry) != NULL) return;
    snprintf(entry + key, sizeof entry - (size_t)key, "glass: %.2g}", fmin(MOST_GLASS, (double)s->clear));
    const size_t len = strlen(c->rules), more = strlen(entry) + 2;
    const size_t room = c->room > 0 ? c->room : sizeof c->rules;
    if (len + more >= room)
        c->n_left_out++;
    else
        snprintf(c->rules + len, sizeof c->rules - len, "%s%s", len > 0 ? ", " : "", entry);
}
