/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/view/encode.h"

#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"

const struct view_column view_columns[CLOUD_COLUMNS] = {
    [CLOUD_RANGE] = {"range", "m", VIEW_FLOAT32, 1},
    [CLOUD_REFLECTANCE] = {"reflectance", "dB", VIEW_FLOAT32, 1},
    [CLOUD_AMPLITUDE] = {"amplitude", "dB", VIEW_FLOAT32, 1},
    [CLOUD_TIME] = {"t", "s", VIEW_FLOAT32, 1},
    [CLOUD_LABEL] = {"label", NULL, VIEW_UINT16, 1},
    [CLOUD_STATION] = {"station", NULL, VIEW_UINT16, 1},
    [CLOUD_ECHO] = {"echo", NULL, VIEW_UINT8, 1},
    [CLOUD_ECHO_COUNT] = {"echoes", NULL, VIEW_UINT8, 1},
    [CLOUD_RGB] = {"rgb", NULL, VIEW_UINT8, 3},
};

const struct view_column view_position = {"xyz", "m", VIEW_FLOAT32, 3};
static const char BINARY[] = "application/octet-stream";

const char *view_type_name(enum view_type type)
{
    static const char *const names[] = {"", "uint8", "uint16", "uint32", "float32"};
    return names[type];
}

static size_t value_size(const struct view_column *c)
{
    static const size_t size[] = {0, 1, 2, 4, 4};
    return size[c->type] * c->components;
}

static size_t padded(size_t bytes)
{
    return (bytes + 3) & ~(size_t)3;
}

/* How many of n there are from `first` on, in steps of `every`; no more than `most` and `allowed`. */
static uint32_t count_of(uint32_t n, uint32_t first, uint32_t every, uint32_t most, uint32_t allowed)
{
    const uint32_t there = first < n ? (n - first - 1) / every + 1 : 0;
    const uint32_t asked = most < allowed ? most : allowed;
    return there < asked ? there : asked;
}

/* Both answers have seven numbers after their first four letters. */
static void put_words(char *to, const uint32_t words[7])
{
    for (size_t i = 0; i < 7; i++)
        le_put32(to + 4 * i, words[i]);
}

/* ---- points */

/* The points of an answer. */
struct slice {
    const struct cloud *points;
    const double *origin_m;
    double t0_s;
    uint32_t first, every, n;
};

static void put_positions(const struct slice *s, char *to)
{
    for (uint32_t i = 0; i < s->n; i++) {
        const double *p = s->points->xyz_m[s->first + (size_t)i * s->every];
        for (int k = 0; k < 3; k++)
            le_put_float(to + 12 * (size_t)i + 4 * k, (float)(p[k] - s->origin_m[k]));
    }
}

static void put_column(const struct slice *s, enum cloud_column column, char *to)
{
    size_t from_size;
    const char *array = cloud_array(s->points, column, &from_size);
    const struct view_column *c = &view_columns[column];
    const size_t size = value_size(c);
    for (uint32_t i = 0; i < s->n; i++) {
        const size_t at = s->first + (size_t)i * s->every;
        const char *from = array + at * from_size;
        float f;
        uint16_t u;
        if (column == CLOUD_TIME) {
            le_put_float(to + i * size, (float)(s->points->time_s[at] - s->t0_s));
        } else if (c->type == VIEW_FLOAT32) {
            memcpy(&f, from, sizeof f);
            le_put_float(to + i * size, f);
        } else if (c->type == VIEW_UINT16) {
            memcpy(&u, from, sizeof u);
            le_put16(to + i * size, u);
        } else {
            memcpy(to + i * size, from, size);
        }
    }
}

static void put_row(char *to, const struct view_column *c, size_t offset)
{
    memcpy(to, c->name, strlen(c->name));
    le_put32(to + 20, (uint32_t)c->type);
    le_put32(to + 24, c->components);
    le_put32(to + 28, (uint32_t)offset);
}

/* Returns the length of the answer, and writes it where body is not NULL. */
static size_t lay_out(const struct slice *s, uint32_t n_columns, char *body)
{
    size_t at = VIEW_CLOUD_HEAD + (size_t)n_columns * VIEW_CLOUD_COLUMN, size;
    char *row = body != NULL ? body + VIEW_CLOUD_HEAD : NULL;
    if (body != NULL) {
        put_row(row, &view_position, at);
        put_positions(s, body + at);
    }
    at += 12 * (size_t)s->n;
    for (int c = 0; c < CLOUD_COLUMNS; c++) {
        if (cloud_array(s->points, (enum cloud_column)c, &size) == NULL) continue;
        if (body != NULL) {
            row += VIEW_CLOUD_COLUMN;
            put_row(row, &view_columns[c], at);
            put_column(s, (enum cloud_column)c, body + at);
        }
        at += padded(value_size(&view_columns[c]) * s->n);
    }
    return at;
}

int view_encode_points(const struct cloud *points, const double origin_m[3], double t0_s, const struct view_part *part,
                       struct web_body *body, struct sh_err *err)
{
    const uint32_t all = (uint32_t)points->n, n = count_of(all, part->first, part->every, part->most, VIEW_MAX_POINTS);
    const struct slice s = {points, origin_m, t0_s, part->first, part->every, n};
    uint32_t n_columns = 1;
    size_t size;
    for (int c = 0; c < CLOUD_COLUMNS; c++)
        n_columns += cloud_array(points, (enum cloud_column)c, &size) != NULL;
    const size_t len = lay_out(&s, n_columns, NULL);
    char *to = calloc(1, len);
    if (to == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u points", s.n);
    memcpy(to, "SHCL", 4);
    const uint32_t head[] = {1, s.n, n_columns, part->first, part->every, all, 0};
    put_words(to + 4, head);
    for (int k = 0; k < 3; k++)
        le_put_double(to + 32 + 8 * k, origin_m[k]);
    lay_out(&s, n_columns, to);
    *body = (struct web_body){BINARY, to, len};
    return SH_OK;
}

/* ---- triangles */

int view_encode_mesh(const struct viewed_mesh *m, uint32_t first, uint32_t most, struct web_body *body,
                     struct sh_err *err)
{
    const uint32_t n = count_of(m->n_faces, first, 1, most, VIEW_MAX_TRIANGLES);
    const size_t len = VIEW_MESH_HEAD + 16 * (size_t)n;
    char *to = malloc(len);
    if (to == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u triangles", n);
    memcpy(to, "SHMS", 4);
    const uint32_t head[] = {1, n, first, m->n_faces, m->first_point, m->n_points, (uint32_t)m->n_edges};
    put_words(to + 4, head);
    le_put_double(to + 32, m->mean_edge_m);
    char *face = to + VIEW_MESH_HEAD, *ratio = face + 12 * (size_t)n;
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t f = m->order[first + i];
        for (int k = 0; k < 3; k++)
            le_put32(face + 12 * (size_t)i + 4 * k, m->face[f][k]);
        le_put_float(ratio + 4 * (size_t)i, m->ratio[f]);
    }
    *body = (struct web_body){BINARY, to, len};
    return SH_OK;
}
