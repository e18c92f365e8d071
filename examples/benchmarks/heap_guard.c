/* Which line writes or reads outside of a block of memory, or after it was freed?

   gcc -O2 -fPIC -shared -o build/heap_guard.so examples/benchmarks/heap_guard.c -ldl
   sysctl vm.max_map_count=10000000
   LD_PRELOAD=build/heap_guard.so python -X faulthandler PROGRAM.py

   Each block of GUARD_FROM bytes or more (environment variable, 1024 by default) gets pages of its own and ends where a
   page begins that nobody may touch, up to its alignment of 16 bytes. Freed pages are never used again, and nobody may
   touch them either. A wrong access is a segmentation fault at the line that makes it, which Python's fault handler
   shows; NUMBA_BOUNDSCHECK=1 tells which index it was in a kernel. Smaller blocks are the system's own.

   What it does not see: writes before a block, and into the last 15 bytes behind one whose size is no multiple of 16. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#define PAGE 4096UL
#define REGION (16UL << 40) /* address space for all blocks that there ever are [bytes]; memory is taken as it is used */
#define ALIGNMENT 16UL

extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *block, size_t size);
extern void *__libc_memalign(size_t alignment, size_t size);
extern void __libc_free(void *block);

/* In front of a block, at the beginning of its first page. */
struct header {
  size_t pages; /* with the header's, without the one that nobody may touch */
  size_t size;  /* as it was asked for */
};

static uintptr_t region;
static uintptr_t next_page;
static size_t guarded_from = 1024;
static size_t (*system_usable_size)(void *block);

__attribute__((constructor)) static void begin(void) {
  void *space = mmap(NULL, REGION, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (space == MAP_FAILED)
    abort();
  const char *from = getenv("GUARD_FROM");
  if (from)
    guarded_from = strtoul(from, NULL, 10);
  system_usable_size = dlsym(RTLD_NEXT, "malloc_usable_size");
  next_page = (uintptr_t)space;
  region = (uintptr_t)space;
}

static int is_guarded(const void *block) {
  return region && (uintptr_t)block >= region && (uintptr_t)block < region + REGION;
}

static struct header *header_of(const void *block) {
  /* the header has a page of its own, so that it is found from any place in the first page of the block */
  return (struct header *)(((uintptr_t)block & ~(PAGE - 1)) - PAGE);
}

static void *guarded(size_t alignment, size_t size) {
  if (alignment < ALIGNMENT)
    alignment = ALIGNMENT;
  if (alignment > PAGE || size > REGION / 4)
    return __libc_memalign(alignment, size);
  size_t room = (size + alignment - 1) & ~(alignment - 1);
  size_t pages = 1 + (room + PAGE - 1) / PAGE;
  uintptr_t first = __atomic_fetch_add(&next_page, (pages + 1) * PAGE, __ATOMIC_RELAXED);
  if (first + (pages + 1) * PAGE > region + REGION || mprotect((void *)first, pages * PAGE, PROT_READ | PROT_WRITE)) {
    errno = ENOMEM;
    return NULL;
  }
  *(struct header *)first = (struct header){pages, size};
  return (void *)(first + pages * PAGE - room);
}

void *malloc(size_t size) {
  return region && size >= guarded_from ? guarded(ALIGNMENT, size) : __libc_malloc(size);
}

void *calloc(size_t count, size_t size) {
  size_t bytes;
  if (!region || __builtin_mul_overflow(count, size, &bytes) || bytes < guarded_from)
    return __libc_calloc(count, size);
  return guarded(ALIGNMENT, bytes); /* new pages are zero */
}

void free(void *block) {
  if (!is_guarded(block)) {
    __libc_free(block);
    return;
  }
  struct header *header = header_of(block);
  size_t bytes = header->pages * PAGE; /* a second free of the same block faults here */
  madvise(header, bytes, MADV_DONTNEED);
  mprotect(header, bytes, PROT_NONE);
}

size_t malloc_usable_size(void *block) {
  return is_guarded(block) ? header_of(block)->size : system_usable_size(block);
}

void *realloc(void *block, size_t size) {
  if (!block)
    return malloc(size);
  if (!region || (!is_guarded(block) && size < guarded_from))
    return __libc_realloc(block, size);
  void *moved = malloc(size);
  if (!moved)
    return NULL;
  size_t old = malloc_usable_size(block);
  memcpy(moved, block, old < size ? old : size);
  free(block);
  return moved;
}

void *memalign(size_t alignment, size_t size) {
  return region && size >= guarded_from ? guarded(alignment, size) : __libc_memalign(alignment, size);
}

void *aligned_alloc(size_t alignment, size_t size) {
  return memalign(alignment, size);
}

int posix_memalign(void **block, size_t alignment, size_t size) {
  *block = memalign(alignment, size);
  return *block ? 0 : ENOMEM;
}
