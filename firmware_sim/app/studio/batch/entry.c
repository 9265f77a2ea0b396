/* SPDX-License-Identifier: MIT */
/* Reads a line of a manifest, as batch_manifest_add writes it. jansson and base/json.h both have a json_string, so no
 * file includes both. */
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/app/studio/batch/manifest.h"

void batch_entry_free(struct batch_entry *entry)
{
    free(entry->file);
    *entry = (struct batch_entry){0};
}

/* Returns 0 where the text is too long. */
static int entry_take_text(const char *text, char *buf, size_t len)
{
    return (size_t)snprintf(buf, len, "%s", text) < len;
}

/* Takes a file's name, which must lie in the campaign's folder itself. */
static int take_file(json_t *from, struct batch_file *file)
{
    const char *name, *sha;
    json_int_t bytes;
    if (json_unpack(from, "{s:s,s:I,s:s}", "name", &name, "bytes", &bytes, "sha256", &sha) != 0 || bytes < 0) return 0;
    file->bytes = (uint64_t)bytes;
    return strchr(name, '/') == NULL && entry_take_text(name, file->name, sizeof file->name) &&
           entry_take_text(sha, file->sha, BATCH_SHA_LEN);
}

static int take_files(json_t *from, struct batch_entry *entry)
{
    const size_t n = json_array_size(from);
    entry->file = calloc(n + 1, sizeof *entry->file);
    for (; entry->file != NULL && entry->n_files < n; entry->n_files++)
        if (!take_file(json_array_get(from, entry->n_files), &entry->file[entry->n_files])) return 0;
    return entry->n_files > 0;
}

static int take_entry(json_t *from, struct batch_entry *entry)
{
    struct batch_provenance *made = &entry->made;
    const char *program, *engine, *configuration, *inputs, *settings, *stream;
    json_int_t job, pulses, points;
    json_t *files;
    if (json_unpack(from, "{s:I,s:{s:s,s:s,s:s,s:s,s:s},s:I,s:I,s:s,s:F,s:o}", "job", &job, "made_with", "program",
                    &program, "engine", &engine, "configuration_sha256", &configuration, "inputs_sha256", &inputs,
                    "job_sha256", &settings, "pulses", &pulses, "points", &points, "stream_sha256", &stream, "seconds",
                    &entry->seconds, "files", &files) != 0 ||
        job < 1 || job > BATCH_MAX_JOBS || pulses < 0 || points < 0)
        return 0;
    entry->job = (uint32_t)job;
    entry->pulses = (uint64_t)pulses;
    entry->points = (uint64_t)points;
    return entry_take_text(program, made->program, sizeof made->program) &&
           entry_take_text(engine, made->engine, sizeof made->engine) &&
           entry_take_text(configuration, made->configuration, BATCH_SHA_LEN) &&
           entry_take_text(inputs, made->inputs, BATCH_SHA_LEN) &&
           entry_take_text(settings, made->job, BATCH_SHA_LEN) &&
           entry_take_text(stream, entry->stream_sha, BATCH_SHA_LEN) && take_files(files, entry);
}

int batch_entry_read(const char *line, struct batch_entry *entry)
{
    json_t *root = json_loads(line, 0, NULL);
    *entry = (struct batch_entry){0};
    const int is_one = root != NULL && take_entry(root, entry);
    json_decref(root);
    if (!is_one) batch_entry_free(entry);
    return is_one;
}
