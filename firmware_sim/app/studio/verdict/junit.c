/* SPDX-License-Identifier: MIT */
/* JUnit XML, as continuous integration reads it. A check that was not judged, or whose finding is allowed, is skipped.
 * Any other finding is a failure. */
#include <inttypes.h>
#include <stdio.h>

#include "firmware_sim/app/studio/verdict/verdict.h"

static void put_attribute(FILE *out, const char *name, const char *value)
{
    fprintf(out, " %s=\"", name);
    for (const char *p = value; *p != '\0'; p++) {
        const unsigned char c = (unsigned char)*p;
        if (c == '<' || c == '>' || c == '&' || c == '"' || c == '\'')
            fprintf(out, "&#%u;", c);
        else
            fputc(c < 0x20 || c > 0x7e ? '?' : c, out);
    }
    fputc('"', out);
}

static void put_case(FILE *out, const struct verdict *v, int check)
{
    static const char *const elements[] = {"skipped", NULL, "failure", "skipped"};
    const struct verdict_result *r = &v->check[check];
    fputs("    <testcase", out);
    put_attribute(out, "classname", v->scenario);
    put_attribute(out, "name", verdict_names[check]);
    fputs(" time=\"0\"", out);
    if (elements[r->state] == NULL) {
        fputs("/>\n", out);
        return;
    }
    fprintf(out, ">\n      <%s", elements[r->state]);
    put_attribute(out, "message", r->text);
    if (r->state == VERDICT_FOUND) put_attribute(out, "type", verdict_asks[check]);
    fputs("/>\n    </testcase>\n", out);
}

static void put_suite(FILE *out, const struct verdict *v)
{
    fputs("  <testsuite", out);
    put_attribute(out, "name", v->scenario);
    fprintf(out, " tests=\"%d\" failures=\"%" PRIu32 "\" skipped=\"%" PRIu32 "\" errors=\"0\" time=\"%.3f\">\n",
            VERDICT_N_CHECKS, verdict_count(v, VERDICT_FOUND),
            verdict_count(v, VERDICT_NOT_JUDGED) + verdict_count(v, VERDICT_ALLOWED), v->figures.wall_s);
    for (int check = 0; check < VERDICT_N_CHECKS; check++)
        put_case(out, v, check);
    fputs("  </testsuite>\n", out);
}

void verdict_put_junit(const struct verdict *verdict, uint32_t n, FILE *out)
{
    uint32_t found = 0;
    for (uint32_t i = 0; i < n; i++)
        found += verdict_count(&verdict[i], VERDICT_FOUND);
    fprintf(out,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites tests=\"%" PRIu32 "\" failures=\"%" PRIu32 "\">\n",
            n * (uint32_t)VERDICT_N_CHECKS, found);
    for (uint32_t i = 0; i < n; i++)
        put_suite(out, &verdict[i]);
    fputs("</testsuites>\n", out);
}
