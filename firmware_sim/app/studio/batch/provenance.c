/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/batch/provenance.h"

#include <nettle/base16.h>
#include <nettle/sha2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/infile.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/sidecars.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/files.h"
#include "firmware_sim/config/load.h"

const char *batch_provenance_differs(const struct batch_provenance *a, const struct batch_provenance *b)
{
    if (strcmp(a->program, b->program) != 0) return "another release of the program";
    if (strcmp(a->configuration, b->configuration) != 0) return "another text of the configuration";
    if (strcmp(a->inputs, b->inputs) != 0)
        return "another input file (head profile, mesh, texture, copies, trajectory, pulse, directions or scenario)";
    if (strcmp(a->job, b->job) != 0) return "another station, other values of keys or other options";
    return strcmp(a->engine, b->engine) != 0 ? "a processor or an Embree of another kind" : NULL;
}

static void take_hex(struct sha256_ctx *ctx, char hex[BATCH_SHA_LEN])
{
    uint8_t digest[SHA256_DIGEST_SIZE];
    sha256_digest(ctx, sizeof digest, digest);
    base16_encode_update(hex, sizeof digest, digest);
    hex[BATCH_SHA_LEN - 1] = '\0';
}

/* Hashes the text with its NUL, so that "ab", "c" differs from "a", "bc". */
static void hash_text(struct sha256_ctx *ctx, const char *text)
{
    sha256_update(ctx, strlen(text) + 1, (const uint8_t *)text);
}

int batch_sha_file(const char *path, char hex[BATCH_SHA_LEN], uint64_t *bytes, const struct sh_report *report,
                   struct sh_err *err)
{
    enum { PART = 1 << 20 };
    struct sha256_ctx ctx;
    const char *why;
    size_t n;
    FILE *in = infile_open(path, &why);
    if (in == NULL) return sh_fail(err, SH_EINPUT, "%s: cannot be read: %s", path, why);
    uint8_t *part = malloc(PART);
    int rc = part != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "%s: no memory to read it", path);
    sha256_init(&ctx);
    *bytes = 0;
    while (rc == SH_OK && (n = fread(part, 1, PART, in)) > 0) {
        sha256_update(&ctx, n, part);
        *bytes += n;
        rc = sh_check_stop(report, err);
    }
    if (rc == SH_OK && ferror(in)) rc = sh_fail(err, SH_EIO, "%s: cannot be read", path);
    take_hex(&ctx, hex);
    free(part);
    fclose(in);
    return rc;
}

/* ---- input files */

static void forget_sidecars(struct batch_known *k)
{
    for (size_t i = 0; i < k->n_sidecars; i++)
        free(k->sidecar[i]);
    k->n_sidecars = 0;
    k->is_searched = 0;
}

void batch_cache_free(struct batch_cache *cache)
{
    for (size_t i = 0; i < cache->n; i++) {
        forget_sidecars(&cache->known[i]);
        free(cache->known[i].sidecar);
        free(cache->known[i].path);
    }
    free(cache->known);
    *cache = (struct batch_cache){0};
}

static struct batch_known *provenance_find(struct batch_cache *cache, const char *path)
{
    for (size_t i = 0; i < cache->n; i++)
        if (strcmp(cache->known[i].path, path) == 0) return &cache->known[i];
    if (!grow(&cache->known, &cache->room, cache->n + 1, sizeof *cache->known)) return NULL;
    struct batch_known *k = &cache->known[cache->n];
    *k = (struct batch_known){.path = strdup(path)};
    if (k->path == NULL) return NULL;
    cache->n++;
    return k;
}

static int is_as_it_was(const struct batch_known *k, const struct stat *st)
{
    return k->sha[0] != '\0' && k->st.st_dev == st->st_dev && k->st.st_ino == st->st_ino &&
           k->st.st_size == st->st_size && k->st.st_mtim.tv_sec == st->st_mtim.tv_sec &&
           k->st.st_mtim.tv_nsec == st->st_mtim.tv_nsec;
}

struct inputs {
    struct sha256_ctx ctx;
    struct batch_cache *cache;
    const struct sh_report *report;
    struct sh_err *err;
    int rc;
};

static const char *sha_of(struct inputs *in, const char *path)
{
    struct stat st = {0};
    uint64_t bytes;
    struct batch_known *k = provenance_find(in->cache, path);
    if (k == NULL) {
        in->rc = sh_fail(in->err, SH_ENOMEM, "no memory for the names of input files");
        return "";
    }
    if (stat(path, &st) == 0 && is_as_it_was(k, &st)) return k->sha;
    k->st = st;
    forget_sidecars(k);
    in->rc = batch_sha_file(path, k->sha, &bytes, in->report, in->err);
    if (in->rc != SH_OK) k->sha[0] = '\0';
    return k->sha;
}

/* Hashes the contents of a file, and what it is for. */
static void take_file(struct inputs *in, const char *what, const char *path)
{
    if (in->rc != SH_OK) return;
    hash_text(&in->ctx, what);
    hash_text(&in->ctx, sha_of(in, path));
}

static int keep_sidecar(void *ctx, const char *name, const char *path)
{
    struct batch_known *k = ctx;
    if (!grow(&k->sidecar, &k->sidecars_room, k->n_sidecars + 2, sizeof *k->sidecar)) return SH_ENOMEM;
    char *copy[2] = {strdup(name), strdup(path)};
    if (copy[0] != NULL && copy[1] != NULL) {
        memcpy(&k->sidecar[k->n_sidecars], copy, sizeof copy);
        k->n_sidecars += 2;
        return SH_OK;
    }
    free(copy[0]);
    free(copy[1]);
    return SH_ENOMEM;
}

/* Takes the files that a mesh names. A mesh is searched for them once, since it may be large. */
static void take_sidecars(struct inputs *in, const char *path)
{
    if (in->rc != SH_OK) return;
    struct batch_known *k = provenance_find(in->cache, path); /* it is there by now */
    if (!k->is_searched) {
        in->rc = app_sidecars(path, keep_sidecar, k, in->err);
        if (in->rc == SH_ENOMEM) sh_fail(in->err, SH_ENOMEM, "no memory for the names of input files");
        if (in->rc != SH_OK) return;
        k->is_searched = 1;
    }
    const size_t at = (size_t)(k - in->cache->known);
    for (size_t i = 0; i < in->cache->known[at].n_sidecars; i += 2) /* taking a file may move the cache */
        take_file(in, in->cache->known[at].sidecar[i], in->cache->known[at].sidecar[i + 1]);
}

/* Files under scene.meshes are meshes, and lists of copies. Such a list is searched, too, but names no other file. */
static int take_input(void *ctx, const char *key, const char *path, int is_written)
{
    struct inputs *in = ctx;
    if (is_written) return SH_OK;
    take_file(in, key, path);
    if (strncmp(key, "scene.meshes", strlen("scene.meshes")) == 0) take_sidecars(in, path);
    return in->rc;
}

/* Takes the files of other scanners that stations have. */
static void take_other_heads(struct inputs *in, const struct config *cfg)
{
    struct config *own = calloc(1, sizeof *own);
    if (own == NULL) in->rc = sh_fail(in->err, SH_ENOMEM, "no memory for a scanner");
    for (uint32_t i = 0; i < cfg->n_stations && in->rc == SH_OK; i++) {
        if (config_serves(cfg, i) || cfg->station[i].scanner != i + 1) continue;
        in->rc = config_load_scanner(cfg, i + 1, own, in->err);
        if (in->rc == SH_OK) config_each_file(own, take_input, in);
    }
    free(own);
}

int batch_provenance_of(const struct config *cfg, struct batch_cache *cache, struct batch_provenance *made,
                        const struct sh_report *report, struct sh_err *err)
{
    struct inputs in = {.cache = cache, .report = report, .err = err};
    const char *text = sha_of(&in, cfg->file);
    snprintf(made->configuration, sizeof made->configuration, "%s", text);
    sha256_init(&in.ctx);
    if (in.rc == SH_OK) config_each_file(cfg, take_input, &in);
    if (in.rc == SH_OK && !config_is_alone(cfg)) take_other_heads(&in, cfg);
    take_hex(&in.ctx, made->inputs);
    return in.rc;
}

void batch_provenance_job(struct batch_provenance *made, const char *const *text, uint32_t n)
{
    struct sha256_ctx ctx;
    sha256_init(&ctx);
    for (uint32_t i = 0; i < n; i++)
        hash_text(&ctx, text[i]);
    take_hex(&ctx, made->job);
}
