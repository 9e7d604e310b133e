#include "render/imgui_renderer.h"

#include <imgui.h>
#include <parallax_shaders.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/check.h"

namespace parallax {
namespace {
void* texture_id(GLuint id) { return reinterpret_cast<void*>(static_cast<std::uintptr_t>(id)); }
}  // namespace

ImguiRenderer::ImguiRenderer()
    : program_("interface", shaders::interface_vertex, shaders::interface_fragment),
      array_(GlVertexArray::make()),
      vertices_(GlBuffer::make()),
      indices_(GlBuffer::make()) {
  gl().BindVertexArray(array_.id());
  gl().BindBuffer(GL_ARRAY_BUFFER, vertices_.id());
  gl().BindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices_.id());
  const auto attribute = [](GLuint location, GLint size, GLenum type, GLboolean normalised, std::size_t offset) {
    gl().EnableVertexAttribArray(location);
    gl().VertexAttribPointer(location, size, type, normalised, sizeof(ImDrawVert),
                             reinterpret_cast<const void*>(offset));
  };
  attribute(0, 2, GL_FLOAT, GL_FALSE, offsetof(ImDrawVert, pos));
  attribute(1, 2, GL_FLOAT, GL_FALSE, offsetof(ImDrawVert, uv));
  attribute(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, offsetof(ImDrawVert, col));
  gl().BindVertexArray(0);
}

void ImguiRenderer::update_fonts() {
  ImFontAtlas* atlas = ImGui::GetIO().Fonts;
  unsigned char* pixels = nullptr;
  int width = 0, height = 0;
  atlas->GetTexDataAsRGBA32(&pixels, &width, &height);
  if (atlas == atlas_ && pixels == atlas_pixels_ && atlas->TexID == texture_id(fonts_.id())) return;
  fonts_.upload(cv::Mat4b(height, width, reinterpret_cast<cv::Vec4b*>(pixels)));
  atlas->SetTexID(texture_id(fonts_.id()));
  atlas_ = atlas;
  atlas_pixels_ = pixels;
}

void* ImguiRenderer::picture(int key, const cv::Mat& image) {
  GlTexture& texture = pictures_[key];
  texture.upload(image);
  return texture_id(texture.id());
}

void ImguiRenderer::draw(const ImDrawData& data, int framebuffer_width, int framebuffer_height) {
  if (framebuffer_width < 1 || framebuffer_height < 1 || !(data.DisplaySize.x > 0) || !(data.DisplaySize.y > 0)) return;
  update_fonts();
  gl().Viewport(0, 0, framebuffer_width, framebuffer_height);
  gl().Enable(GL_BLEND);
  gl().BlendEquation(GL_FUNC_ADD);
  gl().BlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
  gl().Disable(GL_DEPTH_TEST);
  gl().Disable(GL_CULL_FACE);
  gl().Enable(GL_SCISSOR_TEST);
  program_.use();
  gl().Uniform2f(program_.uniform("display_origin"), data.DisplayPos.x, data.DisplayPos.y);
  gl().Uniform2f(program_.uniform("display_size"), data.DisplaySize.x, data.DisplaySize.y);
  gl().Uniform1i(program_.uniform("surface"), 0);
  gl().BindVertexArray(array_.id());
  gl().BindBuffer(GL_ARRAY_BUFFER, vertices_.id());
  const float scale_x = static_cast<float>(framebuffer_width) / data.DisplaySize.x;
  const float scale_y = static_cast<float>(framebuffer_height) / data.DisplaySize.y;
  for (int n = 0; n < data.CmdListsCount; ++n) {
    const ImDrawList& list = *data.CmdLists[n];
    gl().BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(list.VtxBuffer.Size * sizeof(ImDrawVert)),
                    list.VtxBuffer.Data, GL_STREAM_DRAW);
    gl().BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(list.IdxBuffer.Size * sizeof(ImDrawIdx)),
                    list.IdxBuffer.Data, GL_STREAM_DRAW);
    for (const ImDrawCmd& command : list.CmdBuffer) {
      if (command.UserCallback != nullptr) {
        if (command.UserCallback != ImDrawCallback_ResetRenderState) command.UserCallback(&list, &command);
        continue;
      }
      const float left = (command.ClipRect.x - data.DisplayPos.x) * scale_x;
      const float top = (command.ClipRect.y - data.DisplayPos.y) * scale_y;
      const float right = (command.ClipRect.z - data.DisplayPos.x) * scale_x;
      const float bottom = (command.ClipRect.w - data.DisplayPos.y) * scale_y;
      if (right <= left || bottom <= top) continue;
      gl().Scissor(static_cast<GLint>(std::max(0.0f, left)),
                   static_cast<GLint>(std::max(0.0f, static_cast<float>(framebuffer_height) - bottom)),
                   static_cast<GLsizei>(std::ceil(right - std::max(0.0f, left))),
                   static_cast<GLsizei>(std::ceil(std::min(bottom, static_cast<float>(framebuffer_height)) - top)));
      // The first frame was composed before the font's texture had a name.
      const void* texture = command.GetTexID() != nullptr ? command.GetTexID() : texture_id(fonts_.id());
      gl().ActiveTexture(GL_TEXTURE0);
      gl().BindTexture(GL_TEXTURE_2D, static_cast<GLuint>(reinterpret_cast<std::uintptr_t>(texture)));
      gl().DrawElementsBaseVertex(GL_TRIANGLES, static_cast<GLsizei>(command.ElemCount),
                                  sizeof(ImDrawIdx) == 2 ? GL_UNSIGNED_SHORT : GL_UNSIGNED_INT,
                                  reinterpret_cast<const void*>(command.IdxOffset * sizeof(ImDrawIdx)),
                                  static_cast<GLint>(command.VtxOffset));
    }
  }
  gl().BindVertexArray(0);
  gl().BindTexture(GL_TEXTURE_2D, 0);
  gl().Disable(GL_SCISSOR_TEST);
  gl().Disable(GL_BLEND);
  gl().UseProgram(0);
  check_gl("the interface");
}

}  // namespace parallax
