/* SPDX-License-Identifier: MIT */
/* Points from text: a line each, with numbers between blanks, commas, semicolons or tabs. Between commas or semicolons
 * a cell may be empty, or text. The first three cells are x, y and z, unless a line of names says which ones are. */
#include <stdbool.h>
#include <string.h>
#include <strings.h>

#include "core/studio/analysis/cloud_readers.h"
#include "core/text.h"

enum { MAX_COLUMNS = 64 };

struct table {
    struct text t;
    struct cloud *cloud;
    int column[3];  /* of x, y, z */
    char separator; /* of the line of names; 0: there is none, and each line has its own */
    size_t n, n_other;
    uint64_t first_other; /* number of the first line that is neither a point nor names; n_other counts them */
};

/* Returns what separates the cells of a line: semicolons if it has some, else commas if it has some, else blanks. */
static char separator_of(const struct text *t)
{
    const size_t len = strcspn(t->p, "\r\n");
    return memchr(t->p, ';', len) != NULL ? ';' : memchr(t->p, ',', len) != NULL ? ',' : ' ';
}

/* The separator becomes a blank, so that a number before it ends there. Where semicolons separate, a comma is a decimal
 * point. */
static struct text_span cut_cell(struct text *t, char separator)
{
    char *p = t->data + (t->p - t->data), *from;
    while (p < t->end && (*p == ' ' || *p == '\t'))
        p++;
    for (from = p; p < t->end && *p != '\n' && *p != '\r' && *p != separator; p++)
        if (separator == ';' && *p == ',') *p = '.';
    t->p = p;
    if (p < t->end && *p == separator) {
        *p = ' ';
        t->p++;
    }
    while (p > from && (p[-1] == ' ' || p[-1] == '\t'))
        p--;
    return (struct text_span){from, (size_t)(p - from)};
}

/* Returns the number of cells. With separators some may be empty. */
static int cut_line(struct text *t, char separator, struct text_span cell[MAX_COLUMNS])
{
    int n = 0;
    for (; n < MAX_COLUMNS && !text_at_line_end(t); n++) {
        cell[n] = separator == ' ' ? text_word(t) : cut_cell(t, separator);
        if (separator == ' ' && cell[n].n == 0) break;
    }
    return n;
}

static bool is_number(struct text *t, struct text_span cell, double *value)
{
    const char *const after = t->p;
    t->p = cell.p;
    const bool is = cell.n > 0 && text_number(t, value) && t->p == cell.p + cell.n;
    t->p = after;
    return is;
}

/* Whether the cells name all three columns. "# x y z" and "#x y z" do, too. */
static bool read_names(struct table *g, const struct text_span *cell, int n)
{
    static const char *const names[] = {"x", "y", "z"};
    int found[3] = {-1, -1, -1};
    const int is_alone = n > 0 && cell[0].n == 1 && *cell[0].p == '#';
    for (int i = is_alone; i < n; i++) {
        struct text_span word = cell[i];
        if (i == 0 && word.n > 1 && *word.p == '#') {
            word.p++;
            word.n--;
        }
        for (int k = 0; k < 3; k++)
            if (text_is_word(word, names[k])) found[k] = i - is_alone;
    }
    if (found[0] < 0 || found[1] < 0 || found[2] < 0) return false;
    memcpy(g->column, found, sizeof found);
    return true;
}

static int take_line(struct table *g, struct sh_err *err)
{
    struct text_span cell[MAX_COLUMNS];
    double p[3], first;
    int n_numbers = 0;
    if (text_at_line_end(&g->t)) return SH_OK;
    const char separator = g->separator != 0 ? g->separator : separator_of(&g->t);
    const int n = cut_line(&g->t, separator, cell);
    for (int k = 0; k < 3; k++)
        n_numbers += g->column[k] < n && is_number(&g->t, cell[g->column[k]], &p[k]);
    if (n_numbers == 3) {
        memcpy(g->cloud->xyz_m[g->n++], p, sizeof p);
        return cloud_check_position(&g->t, g->t.line, p, err);
    }
    if (n > 0 && !is_number(&g->t, cell[0], &first) && read_names(g, cell, n)) {
        g->separator = separator;
        return SH_OK;
    }
    if (g->n_other++ == 0) g->first_other = g->t.line;
    return SH_OK;
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
    int rc = cloud_make_room(g->cloud, count_lines(&g->t), 0, err);
    for (; rc == SH_OK && g->t.p < g->t.end; text_next_line(&g->t)) {
        rc = take_line(g, err);
        if (rc == SH_OK && g->t.line % 65536 == 0) rc = sh_check_stop(report, err);
    }
    g->cloud->n = g->n;
    g->cloud->is_text = 1;
    if (rc != SH_OK) return rc;
    if (g->n == 0 && g->separator != 0)
        return text_fail(&g->t, g->first_other, SH_EINPUT, err,
                         "no line has numbers in the columns that the line of names calls x, y and z");
    if (g->n == 0)
        return text_fail(&g->t, 0, SH_EINPUT, err,
                         "no line of it is a point; allowed are PLY, LAS, PCD, and lines that begin with x, y and z");
    if (g->n_other > 1)
        sh_warn(report, "%s: %zu lines are no points, and are left out; the first is line %llu", g->t.path, g->n_other,
                (unsigned long long)g->first_other);
    return rc;
}

/* The lines of a PTX file would be taken for points, and so would its header. */
static int is_ptx(const char *path)
{
    const char *ending = strrchr(path, '.');
    return ending != NULL && strcasecmp(ending, ".ptx") == 0;
}

int cloud_read_text(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err)
{
    if (is_ptx(path)) return sh_fail(err, SH_EINPUT, "%s: PTX is not read; allowed are PLY, LAS, PCD and text", path);
    struct table g = {.cloud = out, .column = {0, 1, 2}};
    int rc = text_open(&g.t, path, NULL, NULL, err);
    if (rc == SH_OK) rc = read_lines(&g, report, err);
    text_close(&g.t);
    return rc;
}
