/* SPDX-License-Identifier: MIT */
/* Work that several threads share, each taking the next piece until there is none. With fewer threads than asked for it
 * takes longer; nothing else changes. */
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

/* Calls work on that many threads. The caller's thread is one of them, and the one that reports. */
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
