/* SPDX-License-Identifier: MIT */
/* Points from text: a line each, with numbers between blanks, commas, semicolons or tabs. The first three are x, y and z,
 * unless a line of names says which columns they are. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "core/studio/analysis/cloud_readers.h"
#include "core/text.h"

enum { MAX_COLUMNS = 64 };

struct table {
    struct text t;
    struct cloud *cloud;
    int column[3]; /* of x, y, z */
    int n_columns; /* that a line needs */
    size_t n, n_other;
};

static int read_row(struct text *t, double v[MAX_COLUMNS])
{
    int n = 0;
    for (text_skip_blanks(t); n < MAX_COLUMNS && text_number(t, &v[n]); text_skip_blanks(t))
        n++;
    return n;
}

/* A line of names sets the columns, where it names all three. */
static void read_names(struct table *g)
{
    static const char *const names[] = {"x", "y", "z"};
    int found[3] = {-1, -1, -1};
    struct text_span word;
    for (int i = 0; i < MAX_COLUMNS && (word = text_word(&g->t)).n > 0; i++) {
        if (i == 0 && *word.p == '#') { /* "# x y z" and "#x y z" */
            word.p++;
            if (--word.n == 0) {
                i--;
                continue;
            }
        }
        for (int k = 0; k < 3; k++)
            if (text_is_word(word, names[k])) found[k] = i;
    }
    if (found[0] < 0 || found[1] < 0 || found[2] < 0) return;
    g->n_columns = 0;
    for (int k = 0; k < 3; k++) {
        g->column[k] = found[k];
        if (found[k] >= g->n_columns) g->n_columns = found[k] + 1;
    }
}

static int take_line(struct table *g, struct sh_err *err)
{
    double v[MAX_COLUMNS];
    if (text_at_line_end(&g->t)) return SH_OK;
    const int n = read_row(&g->t, v);
    if (n == 0) read_names(g);
    if (n < g->n_columns) {
        g->n_other++;
        return SH_OK;
    }
    double *p = g->cloud->xyz_m[g->n++];
    for (int k = 0; k < 3; k++)
        p[k] = v[g->column[k]];
    return cloud_check_position(&g->t, g->t.line, p, err);
}

static size_t count_lines(const struct text *t)
{
    size_t n = 1;
    for (const char *p = t->p; p < t->end; p++)
        n += *p == '\n' || *p == '\r';
    return n;
}

static int read_lines(struct table *g, const struct sh_report *report, struct sh_err *err)
{
    for (char *p = g->t.data; p < g->t.data + g->t.size; p++)
        if (*p == ',' || *p == ';') *p = ' ';
    int rc = cloud_reserve(g->cloud, count_lines(&g->t), 0, err);
    for (; rc == SH_OK && g->t.p < g->t.end; text_next_line(&g->t)) {
        rc = take_line(g, err);
        if (rc == SH_OK && g->t.line % 65536 == 0) rc = sh_check_stop(report, err);
    }
    g->cloud->n = g->n;
    g->cloud->is_text = 1;
    if (rc != SH_OK) return rc;
    if (g->n == 0)
        return text_fail(&g->t, 0, SH_EINPUT, err,
                         "no line of it is a point; allowed are PLY, LAS, PCD, and lines that begin with x, y and z");
    if (g->n_other > 1) sh_warn(report, "%s: %zu lines are no points, and are left out", g->t.path, g->n_other);
    return rc;
}

/* Its lines look like points, and those of its header do, too. */
static int is_ptx(const char *path)
{
    const char *ending = strrchr(path, '.');
    return ending != NULL && strcasecmp(ending, ".ptx") == 0;
}

int cloud_read_text(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err)
{
    if (is_ptx(path)) return sh_fail(err, SH_EINPUT, "%s: PTX is not read; allowed are PLY, LAS, PCD and text", path);
    struct table g = {.cloud = out, .column = {0, 1, 2}, .n_columns = 3};
    int rc = text_open(&g.t, path, NULL, NULL, err);
    if (rc == SH_OK) rc = read_lines(&g, report, err);
    text_close(&g.t);
    return rc;
}
