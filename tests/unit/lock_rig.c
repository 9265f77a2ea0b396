/* SPDX-License-Identifier: MIT */
#include "tests/unit/lock_rig.h"

#include <dlfcn.h>
#include <pthread.h>
#include <string.h>

_Thread_local int lock_rig_taken, lock_rig_held;

static int call_next(const char *name, pthread_mutex_t *mutex)
{
    int (*next)(pthread_mutex_t *);
    void *found = dlsym(RTLD_NEXT, name);
    memcpy(&next, &found, sizeof next);
    return next(mutex);
}

int pthread_mutex_lock(pthread_mutex_t *mutex)
{
    lock_rig_taken++;
    lock_rig_held++;
    return call_next("pthread_mutex_lock", mutex);
}

int pthread_mutex_unlock(pthread_mutex_t *mutex)
{
    lock_rig_held--;
    return call_next("pthread_mutex_unlock", mutex);
}
