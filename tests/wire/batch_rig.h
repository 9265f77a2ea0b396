/* SPDX-License-Identifier: MIT */
/* A campaign of six jobs in a test's folder: it is started, run to its end, and compared with another one. These
 * functions fail the running test. */
#ifndef TESTS_WIRE_BATCH_RIG_H
#define TESTS_WIRE_BATCH_RIG_H

#include "tests/wire/wire.h"

enum { BATCH_JOBS = 6 };
extern const char *const batch_names[BATCH_JOBS]; /* of the jobs' files, without an ending */

/* The words of a campaign in `dir`, after those in `first`. `more` ends with NULL, or is NULL. */
struct batch_words {
    const char *word[WIRE_MAX_ARGS];
    char config[352], dir[352];
    int n;
};
#define WITH(...) ((const char *const[]){__VA_ARGS__, NULL})
void batch_campaign(struct wire *wire, struct batch_words *w, const char *const *first, const char *dir,
                    const char *const *more);

pid_t batch_start(struct wire *wire, const char *dir, const char *const *more);
int batch_call(struct wire *wire, const char *dir, const char *const *more); /* its status */
/* Runs the campaign to this status, with this text among its errors. */
void batch_expect(struct wire *wire, const char *dir, const char *const *more, int status, const char *says);
void batch_whole(struct wire *wire, const char *dir);
void batch_shards(struct wire *wire, const char *dir, int n, const char *threads);

/* Paths that are good as long as those of wire_path. */
const char *batch_in(const struct wire *wire, const char *dir, const char *name);
const char *batch_file(const struct wire *wire, const char *dir, int job, const char *ending);

void batch_expect_same(const char *path, const char *other);
/* Both campaigns have the same files and the same manifest, and all of their files are whole. */
void batch_expect_equal(struct wire *wire, const char *dir, const char *other);
/* Replaces a text in a file once. */
void batch_change(const char *path, const char *from, const char *to);

int batch_setup(void **state);
int batch_teardown(void **state);
/* For the group: makes the correct campaign once. "ref" leads to it in the folder of each test that is set up with
 * it. */
int batch_make_ref(void **state);
int batch_remove_ref(void **state);
int batch_setup_with_ref(void **state);

#endif
