/* SPDX-License-Identifier: MIT */
/* Work that several threads share: each thread takes the next piece until no piece is left. If fewer threads can be
 * made than the caller asks for, the work takes longer; nothing else changes. */
#ifndef CORE_TOGETHER_H
#define CORE_TOGETHER_H

#include <pthread.h>
#include <stddef.h>

enum { TOGETHER_MAX = 256 };

struct together {
    void (*work)(void *ctx, int reports);
    void *ctx;
};

static inline void *together_main(void *together)
{
    const struct together *t = together;
    t->work(t->ctx, 0);
    return NULL;
}

/* Calls work on that many threads, but on TOGETHER_MAX + 1 at most. The caller's thread is one of them. `reports` is 1
 * in the caller's thread, which may report progress, and 0 in the others. */
static inline void together(unsigned threads, void (*work)(void *ctx, int reports), void *ctx)
{
    struct together t = {work, ctx};
    pthread_t helper[TOGETHER_MAX];
    unsigned n = 0;
    while (n + 1 < threads && n < TOGETHER_MAX && pthread_create(&helper[n], NULL, together_main, &t) == 0)
        n++;
    work(ctx, 1);
    while (n > 0)
        pthread_join(helper[--n], NULL);
}

#endif
