/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/view/serve.h"

#include <math.h>
#include <string.h>

#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/page_query.h"
#include "firmware_sim/app/studio/record/line.h"
#include "firmware_sim/app/studio/view/encode.h"

enum { MAX_WORDS = 6 };

/* ---- resources */

static int get_head(struct view_serve *s, const char *query, struct web_body *out, struct sh_err *err)
{
    struct page_word words[] = {{.name = NULL}};
    int rc = page_read_query(words, query, err);
    return rc == SH_OK ? page_json(view_put_head, s->viewed, out, err) : rc;
}

static int get_cloud(struct view_serve *s, const char *query, struct web_body *out, struct sh_err *err)
{
    const struct viewed *v = s->viewed;
    struct page_word words[] = {{"first", 0, UINT32_MAX, 1, 0},
                                {"count", 1, UINT32_MAX, 1, VIEW_MAX_POINTS},
                                {"every", 1, UINT32_MAX, 1, 1},
                                {.name = NULL}};
    const int rc = page_read_query(words, query, err);
    if (rc != SH_OK) return rc;
    const struct view_part part = {(uint32_t)words[0].value, (uint32_t)words[2].value, (uint32_t)words[1].value};
    return view_encode_points(&v->points, v->origin_m, v->t0_s, &part, out, err);
}

static int need_mesh(const struct viewed *v, struct sh_err *err)
{
    return v->n_meshes > 0 ? SH_OK : sh_fail(err, SH_EINPUT, "no mesh: %s", v->why_no_mesh);
}

static int get_mesh(struct view_serve *s, const char *query, struct web_body *out, struct sh_err *err)
{
    const struct viewed *v = s->viewed;
    struct page_word words[] = {{"scan", 1, (double)v->n_meshes, 1, (double)NAN},
                                {"first", 0, UINT32_MAX, 1, 0},
                                {"count", 1, UINT32_MAX, 1, VIEW_MAX_TRIANGLES},
                                {.name = NULL}};
    int rc = need_mesh(v, err);
    if (rc == SH_OK) rc = page_read_query(words, query, err);
    return rc == SH_OK ? view_encode_mesh(&v->mesh[(size_t)words[0].value - 1], (uint32_t)words[1].value,
                                          (uint32_t)words[2].value, out, err)
                       : rc;
}

/* Spreads the points of a request. Where the last request asked for the same points, s->sparse still has them. */
static int make_sparse(struct view_serve *s, const struct view_spread *wish, struct sh_err *err)
{
    const struct view_spread *last = &s->wish;
    if (s->made && last->per_m2 == wish->per_m2 && last->long_edge == wish->long_edge && last->seed == wish->seed &&
        last->scan == wish->scan)
        return SH_OK;
    cloud_free(&s->sparse);
    s->made = 0;
    int rc = view_spread(s->viewed, wish, s->report, &s->sparse, err);
    if (rc != SH_OK) return rc;
    s->made = 1;
    s->wish = *wish;
    return SH_OK;
}

static int get_sparse(struct view_serve *s, const char *query, struct web_body *out, struct sh_err *err)
{
    const struct viewed *v = s->viewed;
    struct page_word words[MAX_WORDS + 1] = {
        {"per_m2", 1e-6, 1e9, 0, (double)NAN},  {"long_edge", 0, 1e9, 0, RECORD_LONG_EDGE},
        {"scan", 0, (double)v->n_meshes, 1, 0}, {"seed", 0, 1e9, 1, 1},
        {"first", 0, UINT32_MAX, 1, 0},         {"count", 1, UINT32_MAX, 1, VIEW_MAX_POINTS}};
    int rc = need_mesh(v, err);
    if (rc == SH_OK) rc = page_read_query(words, query, err);
    if (rc != SH_OK) return rc;
    const struct view_spread wish = {words[0].value, words[1].value, (uint64_t)words[3].value,
                                     (uint64_t)words[2].value};
    rc = make_sparse(s, &wish, err);
    const struct view_part part = {(uint32_t)words[4].value, 1, (uint32_t)words[5].value};
    return rc == SH_OK ? view_encode_points(&s->sparse, v->origin_m, v->t0_s, &part, out, err) : rc;
}

int view_serve_get(void *ctx, const char *path, const char *query, struct web_body *out, struct sh_err *err)
{
    static const struct {
        const char *path;
        int (*get)(struct view_serve *serve, const char *query, struct web_body *out, struct sh_err *err);
    } all[] = {{"/head", get_head}, {"/cloud", get_cloud}, {"/mesh", get_mesh}, {"/sparse", get_sparse}};
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        if (strcmp(path, all[i].path) == 0) return all[i].get(ctx, query, out, err);
    return SH_EINPUT; /* nothing is there */
}

void view_serve_free(struct view_serve *s)
{
    cloud_free(&s->sparse);
    s->made = 0;
}
